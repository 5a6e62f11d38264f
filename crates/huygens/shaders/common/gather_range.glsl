// The sum over a range of the VPLs, or over a subset of it.

// The VPL at place k of what is summed, and its number. Each tier has its own.
Vpl vpl_at(int k, out int i);

// Those that are in lists give only what common/near.glsl leaves.
float part_of(float inside)
{
    return (range.w & 2u) != 0u ? 1.0 - inside : 1.0;
}

Term term_at(Receiver r, int k)
{
    int i;
    Vpl vpl = vpl_at(k, i);
    return term_of(r, i, vpl);
}

// Adds the VPLs at the places k, k + stride … below `end`: 32 at a time, first which of them give light, then those.
// Lanes that run together take as many rounds as the one that needs most, so they do only what is needed in each,
// those that are rectangles apart, and no loop has a round in which nothing is left to do.
void add_vpls(Receiver r, int k, int end, int stride, inout vec3 diffuse, inout vec3 specular)
{
    if (k < end) {
        do {
            uint points = 0u, rectangles = 0u, bit = 1u;
            int at = k;
            do {
                Term t = term_at(r, at);
                uint lights = t.lights ? bit : 0u;
                points |= is_rectangle(t) ? 0u : lights;
                rectangles |= is_rectangle(t) ? lights : 0u;
                at += stride;
                bit <<= 1;
            } while (bit != 0u && at < end);
            if (points != 0u) {
                do {
                    Term t = term_at(r, k + lowest_bit(points) * stride);
                    add_term(r, t, point_irradiance(t), diffuse, specular);
                    points &= points - 1u;
                } while (points != 0u);
            }
            if (rectangles != 0u) {
                do {
                    Term t = term_at(r, k + lowest_bit(rectangles) * stride);
                    add_term(r, t, rectangle_irradiance(r, t), diffuse, specular);
                    rectangles &= rectangles - 1u;
                } while (rectangles != 0u);
            }
            k = at;
        } while (k < end);
    }
}
