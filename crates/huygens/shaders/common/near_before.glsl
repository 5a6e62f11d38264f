// What near VPLs gave in the frame before, where they and what they light are as they were. An eighth of the pixels,
// in blocks, sums anew, a quarter at rest, and those that were not seen, or whose sums are old.
uniform highp usampler2D s_near_sum;

// Sums over the pixels before, and of their shares.
vec3 near_irradiance = vec3(0.0);
vec3 near_reflected = vec3(0.0);
float near_frames = 0.0;
float known = 0.0;

void keep(float share, ivec2 inside)
{
    NearSum sum = unpack_near(texel_at(s_near_sum, inside, size.zw));
    near_irradiance += share > 0.0 ? share * sum.irradiance : vec3(0.0);
    near_reflected += share > 0.0 ? share * sum.reflected : vec3(0.0);
    near_frames += share * float(sum.frames);
    known += share;
}

// What the pixel's point of the surface had in the frame before, with the frames since it was summed, more where it was known
// in part: 0 if that is not known, or it is the pixel's turn.
NearSum near_before(ivec2 pixel)
{
    ivec2 block = pixel >> 3, parity = block & 1;
    uint kind = uint(parity.x + 2 * parity.y + 4 * (((block.x ^ block.y) >> 1) & 1));
    // What is known in part ages fast: at an edge it would be handed on from pixel to pixel.
    float scale = 1.0 / max(known, 1e-6), frames = near_frames * scale + 1.0 + 4.0 * (1.0 - known);
    // What is old is made anew half way between turns, all of a block in one frame; and after 12 to 15 frames wherever it is, so
    // that not all blocks have it at once where what is seen moves with their turns.
    bool old = frames > (any(equal(uvec2(kind ^ 2u), renew.xy)) ? 6.5 : float(12 + ((5 * block.x + 3 * block.y) & 3)));
    bool kept = known > 0.01 && !old && !any(equal(uvec2(kind), renew.xy));
    return kept ? NearSum(near_irradiance * scale, near_reflected * scale, uint(frames + 0.5)) : NearSum(vec3(0.0), vec3(0.0), 0u);
}
