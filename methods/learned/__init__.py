"""What all methods share that learn a display from captures: Algorithm 1 of Chakravarthula et al. 2020 and Eq. 22."""
