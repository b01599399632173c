"""What is made of an updated model: figures, a report, predicted FRFs, decks for other solvers."""
