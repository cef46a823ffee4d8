// What the network says, done (jflnr/network/flnr.py): windows that are steered, and gains.
//
// It gives, for every one of the finest blocks, ALIKE planes that are added to what must be alike in a
// window, the logarithms of factors on the window's width and on what the block weighs, and C logarithms
// of gains; each but the first is within(v, limit) = limit tanh(v / limit).
//
// Defines beside those of the headers: OUTPUTS, channels of `said`; ALIKE; LARGEST_WIDTH, LARGEST_WEIGHT,
// LARGEST_GAIN, the limits; DARK, a share of the frame's mean.

#include "vectors.h"
#include "sizes.h"
#include "grids.h"
#include "models.h"
#include "network/maps.h"

INLINE real within(real v, float limit)
{
    const real far = exp_below_0(-2 * fabs(v) / limit), reach = limit * (1 - far) / (1 + far);
    return v < 0 ? -reach : reach;
}

INLINE real exp_of(real v)
{
    const real e = exp_below_0(-fabs(v));
    return v > 0 ? 1 / e : e;
}

// Value k of the finest blocks, of which 2 x 2 lie side by side in the channels of `said`.
#define SAID(i) row[((x + (i)) % 2) * said_pitch + (x + (i)) / 2]
INLINE real unpacked(global const float *said, int said_pitch, int x, int y, int k)
{
    global const float *row = said + MAP_AT(0, y / 2, said_pitch, OUTPUTS, 4 * k + 2 * (y % 2));
#if WIDTH == 8
    const float4 even = READ_4(row + x / 2), odd = READ_4(row + said_pitch + x / 2);
    return (real)(
        even.s0, odd.s0, even.s1, odd.s1, even.s2, odd.s2, even.s3, odd.s3);
#else
    return LANES(real, SAID);
#endif
}

// What concerns the windows of the finest blocks: the planes that are added, then the logarithm of the
// factor on the width; and moments, of `COUNT` planes with the noise as the last, that weigh as said. 0
// from column w on, as the mean over coarser blocks needs it. Global size (pitch / WIDTH, h).
#define INSIDE(i) (x + (i) < w ? -1 : 0)
kernel void heed(
    int h, int w, int pitch, int said_pitch, global const float *said, global const float *moments,
    global float *says, global float *weighed)
{
    const int x = (int)get_global_id(0) * WIDTH, y = get_global_id(1);
    if (x >= pitch || y >= h) return;
    moments += AT(x, y, pitch, COUNT);
    weighed += AT(x, y, pitch, COUNT);
    says += AT(x, y, pitch, ALIKE + 1);
    const mask inside = LANES(mask, INSIDE);
    for (int k = 0; k <= ALIKE; ++k) {
        const real value = unpacked(said, said_pitch, x, y, k);
        WRITE(inside ? (k < ALIKE ? value : within(value, LARGEST_WIDTH)) : (real)0, says + k * GROUP);
    }
    const real weight = exp_of(within(unpacked(said, said_pitch, x, y, ALIKE + 1), LARGEST_WEIGHT));
    for (int k = 0; k < COUNT; ++k) {
        const real factor = k < COUNT - 1 ? weight : weight * weight;
        WRITE(inside ? factor * READ(moments + k * GROUP) : (real)0, weighed + k * GROUP);
    }
}

// What decides the windows of one level: ALIKE planes that must be alike, and a factor on the width.
//
// Defines: BEFORE, how many of the `feature_planes` of `features` must be alike without a network; 0
// stands for those that are missing. says: from `heed`, of this level. Global size (pitch / WIDTH, h).
kernel void steer(
    int h, int pitch, int feature_planes, global const float *features, global const float *says,
    global float *windows)
{
    const int x = (int)get_global_id(0) * WIDTH, y = get_global_id(1);
    if (x >= pitch || y >= h) return;
    features += AT(x, y, pitch, feature_planes);
    says += AT(x, y, pitch, ALIKE + 1);
    windows += AT(x, y, pitch, ALIKE + 1);
    for (int k = 0; k < ALIKE; ++k) {
        const real before = k < BEFORE ? READ(features + k * GROUP) : (real)0;
        WRITE(before + READ(says + k * GROUP), windows + k * GROUP);
    }
    WRITE(exp_of(READ(says + ALIKE * GROUP)), windows + ALIKE * GROUP);
}

// The merged models, scaled by max(1 + rate * restored, 0), a number for each 2 x 2 of them (energy.cl),
// and then by the gain. It acts on a little light even where the models predict none, unless the frame
// has none. mean: of the frame, and its sum over blocks (energy.cl). Global size (pitch / WIDTH, h).
#define FACTOR(i) MAX(1 + rate[0] * restored[(x + (i)) / 2], 0)
kernel void correct(
    int h, int pitch, int said_pitch, int restored_pitch, global const float *said,
    global const float *merged, global const float *mean, global const float *rate,
    global const float *restored, global float *corrected)
{
    const int x = (int)get_global_id(0) * WIDTH, y = get_global_id(1);
    if (x >= pitch || y >= h) return;
    restored += (long)(y / 2) * restored_pitch;
    merged += AT(x, y, pitch, MODELS);
    corrected += AT(x, y, pitch, MODELS);
    const real factor = LANES(real, FACTOR);
    const float dark = mean[1] > 0 ? DARK * mean[0] : 0;
    for (int c = 0; c < C; ++c) {
        const real gain =
            exp_of(within(unpacked(said, said_pitch, x, y, ALIKE + 2 + c), LARGEST_GAIN));
        for (int q = 0; q <= Q; ++q) {
            const int k = q * C + c;
            const real value = factor * READ(merged + k * GROUP);
            WRITE(q ? gain * value : gain * (value + dark) - dark, corrected + k * GROUP);
        }
    }
}
