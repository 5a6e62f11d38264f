// The lists of near VPLs: a grid over the scene, for each cell the numbers of the VPLs that are near to points of it, four in
// a texel. `passes/near.rs` writes them.

uniform highp usampler2D s_near;

uvec4 near_texel(int k)
{
    return texelFetch(s_near, ivec2(k & 2047, k >> 11), 0);
}

// The texel in which the list for a point begins, and the number of its VPLs.
ivec2 near_list(vec3 position_ws)
{
    ivec3 cell = clamp(ivec3(floor((position_ws - near_grid.xyz) * near_grid.w)), ivec3(0), near_cells.xyz - 1);
    return ivec2(near_texel(cell.x + near_cells.x * (cell.y + near_cells.y * cell.z)).xy);
}

float part_of(float inside)
{
    return inside;
}

// Of those in a list, what is in the range alone.
Term near_term(Receiver r, uint i)
{
    Term t = term_of(r, int(i), read_vpl(int(i)));
    t.lights = t.lights && i >= range.x && i < range.y;
    return t;
}

// Adds the VPLs of the list for the receiver, as `add_vpls` does. Few are points, so that these are not
// apart.
void add_near(Receiver r, inout vec3 diffuse, inout vec3 specular)
{
    ivec2 list = near_list(r.s.position_ws);
    int at = list.x, left = list.y;
    if (left > 0) {
        do {
            uint lit = 0u;
            int first = at;
            do {
                uvec4 four = near_texel(at);
                for (int k = 0; k < 4; k++) {
                    lit |= k < left && near_term(r, four[k]).lights ? 1u << (4 * (at - first) + k) : 0u;
                }
                at++;
                left -= 4;
            } while (at - first < 8 && left > 0);
            if (lit != 0u) {
                do {
                    int k = lowest_bit(lit);
                    Term t = near_term(r, near_texel(first + (k >> 2))[k & 3]);
                    float as_rectangle = rectangle_irradiance(r, t);
                    add_term(r, t, is_rectangle(t) ? as_rectangle : point_irradiance(t), diffuse, specular);
                    lit &= lit - 1u;
                } while (lit != 0u);
            }
        } while (left > 0);
    }
}

// What there is before the sum: of the ranges before, or where the near VPLs and what they light are as they were of the
// frame before. Then a quarter of the pixels, in blocks, sums anew, and those that were not seen.
uniform sampler2D s_previous;
uniform sampler2D s_previous_specular;

// Frames after which a sum is made anew wherever its pixel is: 5 to 12, so that not all blocks have it at once where what is
// seen moves with their turns.
float oldest(ivec2 pixel)
{
    ivec2 block = pixel >> 3;
    return float(5 + ((5 * block.x + 3 * block.y) & 7));
}

// What the pixel's point of the surface had in the frame before; with 0 frames if that is not known.
void near_before(ivec2 pixel, inout vec4 irradiance, inout vec4 specular)
{
    uvec4 texel = texelFetch(s_surface, pixel, 0);
    if (uintBitsToFloat(texel.x) <= 0.0) {
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
    float scale = 1.0 / max(total, 1e-6), frames = irradiance.a * scale + 1.0;
    bool known = total > 0.5 && frames <= oldest(pixel);
    irradiance = known ? vec4(irradiance.rgb * scale, frames) : vec4(0.0);
    specular = known ? specular * scale : vec4(0.0);
}

// Outputs: irradiance, W/m², with the frames since it was summed; reflected radiance, W/(m² sr).
void sum_near(ivec2 pixel, out vec4 irradiance, out vec4 specular)
{
    irradiance = vec4(0.0);
    specular = vec4(0.0);
    ivec2 block = (pixel >> 3) & 1;
    if (renew.x > 3u) {
        irradiance = texelFetch(s_previous, pixel, 0);
        specular = texelFetch(s_previous_specular, pixel, 0);
    } else if (uint(block.x + 2 * block.y) != renew.x) {
        near_before(pixel, irradiance, specular);
    }
    Receiver r;
    if (irradiance.a > 0.0 || !read_receiver(pixel, r)) {
        return;
    }
    vec3 diffuse = vec3(0.0), reflected = vec3(0.0);
    add_near(r, diffuse, reflected);
    irradiance.rgb += diffuse;
    specular.rgb += reflected;
}
