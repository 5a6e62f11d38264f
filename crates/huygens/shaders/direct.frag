// Direct light of one light: L = f(v, l) · I(ω) · max(0, n·l) · V / d², added to what other lights gave.
// Input: G-buffer, shadow map. Output: radiance, W/(m² sr).

uniform sampler2D s_albedo;
uniform sampler2D s_previous;

layout(location = 0) out vec4 o_radiance;

void main()
{
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    o_radiance = texel_at(s_previous, pixel, size.zw);
    Surface s = read_surface(pixel);
    if (s.depth <= 0.0) {
        return;
    }
    bool parallel = light_position.w > 3.5;
    vec3 to_light = parallel ? -light_axis.xyz : light_position.xyz - s.position_ws;
    float d2 = parallel ? 1.0 : max(dot(to_light, to_light), 1e-36);
    vec3 l = parallel ? to_light : to_light * inversesqrt(d2);
    // Light from below the surface itself is no light, whatever the shading normal says.
    float n_l = dot(s.geometric_normal_ws, l) > 0.0 ? max(dot(s.normal_ws, l), 0.0) : 0.0;

    float cos_theta = -dot(l, light_axis.xyz);
    float cone = clamp(cos_theta * light_axis.w + light_intensity.a, 0.0, 1.0);
    float profile = light_position.w < 0.5 ? (cos_theta >= 0.0 ? 1.0 : 0.0)
                  : light_position.w < 1.5 ? max(cos_theta, 0.0)
                  : light_position.w < 2.5 ? cone * cone
                  : 1.0;
    if (n_l * profile <= 0.0) {
        return;
    }
    vec3 v = normalize(mix(-forward_ws.xyz, eye_ws.xyz - s.position_ws, eye_ws.w));
    vec3 f = brdf(texel_at(s_albedo, pixel, size.zw).rgb, s.metallic, s.roughness, s.specular, s.normal_ws, l, v);
    float visibility = light_visibility(s.position_ws, s.geometric_normal_ws);
    o_radiance.rgb += f * light_intensity.rgb * (profile * n_l * visibility / d2);
}
