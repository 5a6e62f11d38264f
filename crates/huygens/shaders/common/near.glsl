// The lists of near VPLs: a grid over the scene, for each cell the numbers of the VPLs that are near to points of it, four in
// a texel. `passes/near.rs` writes them.

uniform highp usampler2D s_near;

uvec4 near_texel(int k)
{
    return texel_at(s_near, ivec2(k & 2047, k >> 11), near_scale.xy);
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

// Adds what the near VPLs of the range give to a pixel.
void sum_near(ivec2 pixel, inout NearSum sum)
{
    Receiver r;
    if (read_receiver(pixel, r)) {
        vec3 diffuse = vec3(0.0), reflected = vec3(0.0);
        add_near(r, diffuse, reflected);
        sum.irradiance += diffuse;
        sum.reflected += reflected;
    }
}
