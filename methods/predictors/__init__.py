"""Predictions of captures that know more and more of a display: what an error budget is made of."""
