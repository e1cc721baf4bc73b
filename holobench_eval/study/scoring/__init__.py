"""How a cell is scored, with a file for each measure: picture, prediction, focal stack."""
