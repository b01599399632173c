"""Update jobs: a recipe and a campaign in, updated parameters with their uncertainty out."""
