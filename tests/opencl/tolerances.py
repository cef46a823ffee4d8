"""How far the kernels, in float32, may be from JAX in float64: one number per step.

All are relative to the largest magnitude in the plane or image compared. A float has 6e-8; sums of
n terms lose about sqrt(n) of that.
"""

# Sums over 256 pixels at most, products of shifted guides.
MOMENTS = 2e-6
# Two sums of 19 terms.
BLUR = 1e-6
# Slopes of independent guides: differences of moments, then a matrix of small condition.
SOLVE = 2e-5
# Two bilinear interpolations and a sum of Q products.
APPLY = 2e-6
# The four together. What is left after subtracting the squares of means loses most, as it does in
# JAX in float32.
WHOLE = 1e-4
# Adaptive FLR, against JAX in float32, whose ridge knows the rounding of that: windows of few
# pixels, more guides, and what a level adds depends on differences of fits.
ADAPTIVE = 1e-3
# Sums of 49 terms, whose weights are exponentials of sums of squares.
EDGES = 1e-5
# BMFR, fed the same noise: what features that nearly depend on each other do to a fit of few
# pixels, handed on over a sequence.
BMFR = 1e-3
# A layer of the network: sums of up to 9 x 4 products of either sign.
NETWORK = 5e-6
# All of it, with the logarithms that it reads, against JAX in float32.
NETWORK_WHOLE = 2e-5
