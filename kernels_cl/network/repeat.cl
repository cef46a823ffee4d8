// Every value of a map repeated over 2 x 2 blocks of a finer one, for the network's decoder.

#include "vectors.h"
#include "grids.h"
#include "network/maps.h"

#define REPEATED(i) ((x + (i)) < w ? from[(x + (i)) / 2] : 0)

// from: a map of `channels` channels, half as fine. to: a map, whose first `channels` are written.
// Global size ((pitch - MARGIN) / WIDTH, channels, h + 2).
kernel void repeat(
    int h, int w, int pitch, int from_pitch, int channels, int to_count, global const float *from,
    global float *to)
{
    const int x = (int)get_global_id(0) * WIDTH, channel = get_global_id(1);
    const int y = (int)get_global_id(2) - 1;
    if (x >= pitch - MARGIN || channel >= channels || y > h) return;
    to += MAP_AT(x, y, pitch, to_count, channel);
    if (x == 0)
        for (int i = 1; i <= MARGIN; ++i) to[-i] = 0;
    if (y < 0 || y >= h) {
        WRITE((real)0, to);
        return;
    }
    from += MAP_AT(0, y / 2, from_pitch, channels, channel);
#if WIDTH == 8
    if (x + WIDTH <= w) {
        WRITE(READ_4(from + x / 2).s00112233, to);
        return;
    }
#endif
    WRITE(LANES(real, REPEATED), to);
}
