// SPDX-License-Identifier: Apache-2.0
// Method auto: the tiles of the finest grid that are refined, those where enough of what finer models
// add is signal. jflnr/regression/multiscale.py says why.

#include "vectors.h"
#include "grids.h"

// tiles: (ceil(h / 2), tiles_w), 1 where the mean of 2 x 2 blocks of `share` is above `worth`.
// share: (h, pitch) with w columns. Global size (pitch / WIDTH, h).
kernel void choose(
    int h, int w, int pitch, int tiles_w, float worth, global const float *share, global uchar *tiles)
{
    const int x = (int)get_global_id(0) * WIDTH, y = (int)get_global_id(1) * 2;
    for (int tile = (x + 1) / 2; y < h && 2 * tile < x + WIDTH && tile < tiles_w; ++tile) {
        float above = 0;
        for (int j = y; j < MIN(y + 2, h); ++j)
            for (int i = 2 * tile; i < MIN(2 * tile + 2, w); ++i)
                above += share[AT(i, j, pitch, 1)] - worth;
        tiles[y / 2 * tiles_w + tile] = above > 0;
    }
}
