// SPDX-License-Identifier: Apache-2.0
// From red, green and blue to luma, orange and green, and back without loss. Comes after vectors.h.

INLINE void to_ycocg(real *v)
{
    const real r = v[0], g = v[1], b = v[2];
    v[0] = 0.25f * r + 0.5f * g + 0.25f * b;
    v[1] = 0.5f * r - 0.5f * b;
    v[2] = 0.5f * g - 0.25f * r - 0.25f * b;
}

INLINE void to_rgb(real *v)
{
    const real luma = v[0], orange = v[1], green = v[2];
    v[0] = luma + orange - green;
    v[1] = luma + green;
    v[2] = luma - orange - green;
}

// Albedo, or 0 where it is none.
INLINE real usable_albedo(real albedo)
{
    return ABS(albedo) < (float)WHITEST ? albedo : (real)0;
}
