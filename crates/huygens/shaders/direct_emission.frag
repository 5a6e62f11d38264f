// Direct light of emissive surfaces, which VPLs stand for, each for its patch of them: what the gather sums of them
// (common/gather_sum.glsl), reflected and added to what lights gave.
// Input: G-buffer, VPL texture, shadow maps. Output: radiance, W/(m² sr).

uniform sampler2D s_previous;

layout(location = 0) out vec4 o_radiance;

Vpl vpl_at(int k, out int i)
{
    i = k;
    return read_vpl(i);
}

void main()
{
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    o_radiance = texel_at(s_previous, pixel, size.zw);
    Receiver r;
    if (!read_receiver(pixel, r)) {
        return;
    }
    vec3 diffuse = vec3(0.0), specular = vec3(0.0);
    add_vpls(r, int(range.x), int(range.y), 1, diffuse, specular);
    vec3 albedo = texel_at(s_albedo, pixel, size.zw).rgb * (1.0 - r.s.metallic);
    o_radiance.rgb += albedo / PI * diffuse + specular;
}
