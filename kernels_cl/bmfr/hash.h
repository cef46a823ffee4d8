// SPDX-License-Identifier: Apache-2.0
// Noise that depends on nothing but a counter; its twin in JAX is in jflnr/bmfr/fit.py.
// Comes after vectors.h.

// Jarzynski and Olano 2020, "Hash Functions for GPU Rendering".
INLINE bits pcg(bits value)
{
    const bits state = value * 747796405u + 2891336453u;
    const bits word = ((state >> ((state >> 28) + 4)) ^ state) * 277803737u;
    return (word >> 22) ^ word;
}

// In [-1, 1): the upper 23 bits as the fraction of a float in [2, 4).
INLINE real uniform(bits counter, bits key)
{
    return AS_REAL((pcg(counter ^ key) >> 9) | 0x40000000u) - 3;
}
