"""The compiled kernel: convolutions of padded fields, sixteen lines at a time; see ``fused``."""
