"""What is equal in every figure: the colour and marker of each method, and the medium that a figure is drawn for."""
