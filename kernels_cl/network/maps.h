// SPDX-License-Identifier: Apache-2.0
// Maps of the network's channels. Comes after vectors.h and grids.h.
//
// They lie as (h + 2, count, pitch) over h x w blocks: a row of zeros above and below, MARGIN zeros
// before a row's first block and at least one after its last, so that a convolution reads zeros
// beyond the border without asking where it is. All channels of a row lie together.

#define MARGIN GROUP
#define MAP_AT(x, y, pitch, count, channel) \
    ((((long)(y) + 1) * (count) + (channel)) * (pitch) + MARGIN + (x))
