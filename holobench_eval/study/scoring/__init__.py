"""How a cell becomes scores, a measure a file: a picture, a prediction, a focal stack."""
