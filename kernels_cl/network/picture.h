// SPDX-License-Identifier: Apache-2.0
// What the network reads of whole pictures (jflnr/network/picture.py): for features.cl.
//
// Images (H, W, 3) and (H, W), as in `picture.Read`.
//
// Define: MOST_SAMPLES, the most that a pixel is said to be a mean of.

#define IMAGE_PARAMETERS                                                                       \
    global const float *light, global const float *noisy, global const float *error,           \
        global const float *own, global const float *albedo, global const float *albedo_left,  \
        global const float *normal, global const float *normal_left,                           \
        global const float *seen_normal, global const float *depth, global const float *alpha, \
        global const float *weight, global const float *samples
#define IMAGES                                                                               \
    light, noisy, error, own, albedo, albedo_left, normal, normal_left, seen_normal, depth, \
        alpha, weight, samples
#define PIXEL 27

// WIDTH pixels of all channels; zeros beyond the last one, of which there is none if that is below 0.
INLINE void take(
    global const float *image, int channels, long pixel, int last, real *values)
{
    for (int c = 0; c < channels; ++c) {
        values[c] = 0;
        if (last >= 0) {
            const real found = guide_lanes(image + pixel * channels, channels, c, 0, last);
            values[c] = NUMBERS <= last ? found : (real)0;
        }
    }
}

INLINE real take_one(global const float *image, long pixel, int last)
{
    real value[1];
    take(image, 1, pixel, last, value);
    return value[0];
}

// The PIXEL values of WIDTH pixels from (x, y) on, and what is averaged of them.
INLINE void of_pixels(
    int x, int y, int width, int height, IMAGE_PARAMETERS, real *values, real *means)
{
    const long pixel = (long)y * width + x;
    const int last = y < height ? MIN(width - x, WIDTH) - 1 : -1;
    real *fitted = means, *given = means + 3, colour[3], left[3];
    take(light, 3, pixel, last, fitted);
    take(noisy, 3, pixel, last, given);
    const real before = luminance(fitted), after = luminance(given), bright = before + 0.05f;
    means[6] = MIN(after, 4 * before + 0.1f);
    means[7] = (after - before) * (after - before);

    const real wrong = take_one(error, pixel, last);
    take(albedo, 3, pixel, last, colour);
    take(albedo_left, 3, pixel, last, left);
#pragma unroll
    for (int c = 0; c < 3; ++c) {
        values[c] = log_above_0(fitted[c] + DARK);
        values[3 + c] = 0.5f * CLAMP((given[c] - fitted[c]) / bright, -1, 4);
        values[9 + c] = 2 * exp(0.5f * log_above_0(colour[c] + 1e-4f)) - 1;
        values[12 + c] = 2 * left[c];
    }
    values[6] = log_above_0(1 + (after + 0.05f) / bright);
    values[7] = log_above_0(wrong / bright + 0.01f) + 1.5f;
    values[8] = MIN(wrong, 3);
    take(normal, 3, pixel, last, values + 15);
    values[18] = take_one(normal_left, pixel, last);
    take(seen_normal, 3, pixel, last, values + 19);
    values[22] = log_above_0(take_one(depth, pixel, last) + 0.05f);
    values[23] = 2 * take_one(alpha, pixel, last) - 1;
    take(own, 3, pixel, last, colour);
    values[24] = MIN(luminance(colour) / (before + DARK), 1);
    values[25] = take_one(weight, pixel, last);
    const real count = take_one(samples, pixel, last);
    values[26] = 0.25f / M_LN2_F * log_above_0(CLAMP(count, 1, MOST_SAMPLES));
}
