// What near VPLs gave in the frame before, where they and what they light are as they were. An eighth of the pixels,
// in blocks, sums anew, a quarter at rest, and those that were not seen.
uniform sampler2D s_previous;
uniform sampler2D s_previous_specular;

// Frames after which a sum is made anew wherever its pixel is: 9 to 16, so that not all blocks have it at once where what is
// seen moves with their turns.
float oldest(ivec2 pixel)
{
    ivec2 block = pixel >> 3;
    return float(9 + ((5 * block.x + 3 * block.y) & 7));
}

// What the pixel's point of the surface had in the frame before: irradiance, W/m², with the frames since it was summed,
// more where it was known in part; reflected radiance, W/(m² sr). With 0 frames if that is not known, or it is the pixel's
// turn.
void near_before(ivec2 pixel, out vec4 irradiance, out vec4 specular)
{
    irradiance = vec4(0.0);
    specular = vec4(0.0);
    uvec4 texel = texelFetch(s_surface, pixel, 0);
    ivec2 block = pixel >> 3, parity = block & 1;
    int kind = parity.x + 2 * parity.y + 4 * (((block.x ^ block.y) >> 1) & 1);
    if (uintBitsToFloat(texel.x) <= 0.0 || any(equal(uvec2(kind), renew.xy))) {
        return;
    }
    vec3 position = read_position(pixel), normal = oct_decode(unpack_pair(texel.y));
    float near = distance(position, eye_ws.xyz) * size.w;
    Before b = before(pixel, position, normal, oct_decode(unpack_pair(texel.z)), near);
    float total = 0.0;
    if (b.seen) {
        for (int k = 0; k < 4; k++) {
            ivec2 inside;
            uvec4 surface;
            float share = share_of(b, k, inside, surface);
            irradiance += share > 0.0 ? share * texelFetch(s_previous, inside, 0) : vec4(0.0);
            specular += share > 0.0 ? share * texelFetch(s_previous_specular, inside, 0) : vec4(0.0);
            total += share;
        }
    }
    // What is known in part ages fast: at an edge it would be handed on from pixel to pixel.
    float scale = 1.0 / max(total, 1e-6), frames = irradiance.a * scale + 1.0 + 8.0 * (1.0 - total);
    bool known = total > 0.01 && frames <= oldest(pixel);
    irradiance = known ? vec4(irradiance.rgb * scale, frames) : vec4(0.0);
    specular = known ? specular * scale : vec4(0.0);
}
