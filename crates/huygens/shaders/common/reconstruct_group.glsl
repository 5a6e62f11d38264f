// How a workgroup filters: 16 pixels along the direction and 8 across. What it reads of them and of their neighbours up to
// the widest box's end, it reads once, into shared memory.

const int LENGTH = 16, BREADTH = 8;

// Half the widest box: n is 16 at most.
const int REACH = 8;

const int TAPS = LENGTH + 2 * REACH;

// Line by line along the direction.
shared vec4 tap_position[TAPS * BREADTH];
shared vec4 tap_normal[TAPS * BREADTH];
shared vec4 tap_mean[TAPS * BREADTH];
shared vec4 tap_specular[TAPS * BREADTH];

// The first cell in shared memory.
ivec2 first_tap;

Tap tap_at(ivec2 cell)
{
    ivec2 from = cell - first_tap;
    int k = along.x == 1 ? from.x + from.y * TAPS : from.y + from.x * TAPS;
    return Tap(tap_position[k].xyz, tap_normal[k].xyz, tap_mean[k], tap_specular[k].rgb);
}

// Fills shared memory; which place of the result the thread has.
ivec2 fetch_taps()
{
    int thread = int(gl_LocalInvocationIndex);
    ivec2 across = ivec2(1) - along.xy, shape = along.xy * LENGTH + across * BREADTH;
    ivec2 first = ivec2(gl_WorkGroupID.xy) * shape;
    int halved = along.z == 1 ? grid.y : 0;
    // And the column before the first, where pixels lie between two.
    first_tap = (first >> halved) - along.xy * REACH - across * halved;
    for (int k = thread; k < TAPS * BREADTH; k += 128) {
        // Neighbours in a row go to neighbours in memory, whichever the direction.
        ivec2 from = along.x == 1 ? ivec2(k % TAPS, k / TAPS) : ivec2(k % BREADTH, k / BREADTH);
        ivec2 cell = first_tap + from;
        int slot = along.x == 1 ? k : from.y + from.x * TAPS;
        if (all(greaterThanEqual(cell, ivec2(0))) && all(lessThan(cell, cell_count()))) {
            Tap tap = read_tap(cell);
            tap_position[slot] = vec4(tap.position_vs, 0.0);
            tap_normal[slot] = vec4(tap.normal_ws, 0.0);
            tap_mean[slot] = tap.mean;
            tap_specular[slot] = vec4(tap.specular, 0.0);
        }
    }
    barrier();
    return first + ivec2(thread % shape.x, thread / shape.x);
}
