// What the network says, done (jflnr/flnr/regression.py): shares that are changed, and gains.
//
//   odds = exp(within(change, LARGEST_CHANGE)),   within(v, limit) = limit tanh(v / limit)
//   changed = share odds / (1 + share (odds - 1))
//   merged = coarser merged + changed (fine - coarse)
//
// Defines beside those of the headers: OUTPUTS, channels of `said`; LARGEST_CHANGE, LARGEST_GAIN,
// logarithms; DARK, a share of the frame's mean.

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

INLINE real changed(real share, real change)
{
    const real odds = exp_of(within(change, LARGEST_CHANGE));
    return share * odds / (1 + share * (odds - 1));
}

// A level that is not the finest. said: a map on the grid of `fine`, from whose channel `channel` the
// change is taken. fine, coarse, coarse_merged, merged: models. share: of the coarser grid.
// Global size (pitch / WIDTH, h).
kernel void steer(
    int h, int pitch, int coarse_h, int coarse_w, int coarse_pitch, int said_pitch, int channel,
    global const float *said, global const float *fine, global const float *coarse,
    global const float *coarse_merged, global const float *share, global float *merged)
{
    const int x = (int)get_global_id(0) * WIDTH, y = get_global_id(1);
    if (x >= pitch || y >= h) return;
    const coarse_t share_at = coarse_at(share, 1, coarse_h, coarse_w, coarse_pitch, x, y);
    const real change = READ(said + MAP_AT(x, y, said_pitch, OUTPUTS, channel));
    const real part = changed(doubled(&share_at, 0), change);
    merge_models(
        (Q + 1) * C, x, y, pitch, coarse_h, coarse_w, coarse_pitch, fine, coarse, coarse_merged, part,
        merged);
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

// The finest level, whose models are scaled by max(1 + rate * restored, 0), a number for each 2 x 2
// of them (energy.cl), and then by the gain. It acts on a little light even where the models predict
// none, unless the frame has none. mean: of the frame, and its sum over blocks (energy.cl). Global
// size (pitch / WIDTH, h).
#define FACTOR(i) MAX(1 + rate[0] * restored[(x + (i)) / 2], 0)
kernel void finish(
    int h, int pitch, int coarse_h, int coarse_w, int coarse_pitch, int said_pitch,
    int restored_pitch, global const float *said, global const float *fine,
    global const float *coarse, global const float *coarse_merged, global const float *share,
    global const float *mean, global const float *rate, global const float *restored,
    global float *corrected)
{
    const int x = (int)get_global_id(0) * WIDTH, y = get_global_id(1);
    if (x >= pitch || y >= h) return;
    fine += AT(x, y, pitch, MODELS);
    restored += (long)(y / 2) * restored_pitch;
    corrected += AT(x, y, pitch, MODELS);
    const coarse_t at = coarse_at(coarse, MODELS, coarse_h, coarse_w, coarse_pitch, x, y);
    const coarse_t before = coarse_at(coarse_merged, MODELS, coarse_h, coarse_w, coarse_pitch, x, y);
    const coarse_t share_at = coarse_at(share, 1, coarse_h, coarse_w, coarse_pitch, x, y);
    const real part = changed(doubled(&share_at, 0), unpacked(said, said_pitch, x, y, 0));
    const real factor = LANES(real, FACTOR);
    const float dark = mean[1] > 0 ? DARK * mean[0] : 0;
    for (int c = 0; c < C; ++c) {
        const real gain = exp_of(within(unpacked(said, said_pitch, x, y, 1 + c), LARGEST_GAIN));
        for (int q = 0; q <= Q; ++q) {
            const int k = q * C + c;
            const real step = READ(fine + k * GROUP) - doubled(&at, k);
            const real value = factor * (doubled(&before, k) + part * step);
            WRITE(q ? gain * value : gain * (value + dark) - dark, corrected + k * GROUP);
        }
    }
}
