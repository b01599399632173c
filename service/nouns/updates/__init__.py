"""Updates: recipes, the bodies that they update, results and their documents."""
