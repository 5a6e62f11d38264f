// The sum over the VPLs of a range at every pixel, with near_cells.w added to what other ranges gave: see common/gather_range.glsl.
// Inputs: G-buffer, VPL texture, visibility. Outputs: irradiance, W/m², and with range.w radiance that the glossy lobe
// reflects, W/(m² sr); what that reflects is taken from the irradiance.

uniform sampler2D s_previous;
uniform sampler2D s_previous_specular;

layout(location = 0) out vec4 o_irradiance;
layout(location = 1) out vec4 o_specular;

Vpl vpl_at(int k, out int i)
{
    i = k;
    return read_vpl(i);
}

void main()
{
    ivec2 at = ivec2(gl_FragCoord.xy);
    o_irradiance = vec4(0.0);
    o_specular = vec4(0.0);
    if (near_cells.w != 0) {
        vec2 scale = 1.0 / vec2(grid.x * grid.zw);
        o_irradiance = texel_at(s_previous, at, scale);
        o_specular = texel_at(s_previous_specular, at, scale);
    }
    ivec2 place = ivec2((vec2(at) + 0.5) / vec2(grid.zw));
    Receiver r;
    if (!read_receiver(pixel_of(at - place * grid.zw, place), r)) {
        return;
    }
    vec3 diffuse = vec3(0.0), specular = vec3(0.0);
    add_vpls(r, int(range.x) + subset_of(uvec2(place)), int(range.y), int(turn.z), diffuse, specular);
    o_irradiance.rgb += diffuse;
    o_specular.rgb += specular;
}
