// Direct light of emissive surfaces, which VPLs stand for, each for its patch of them:
//   L = Σ f(v, l) · I · cos θ · max(0, n·l) · V / d², near them what the patch gives; added to what lights gave.
// Input: G-buffer, VPL texture, shadow maps. Output: radiance, W/(m² sr).

uniform sampler2D s_albedo;
uniform sampler2D s_previous;

layout(location = 0) out vec4 o_radiance;

void main()
{
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    o_radiance = texelFetch(s_previous, pixel, 0);
    Surface s = read_surface(pixel);
    if (s.depth <= 0.0) {
        return;
    }
    vec3 base = texelFetch(s_albedo, pixel, 0).rgb;
    vec3 v = normalize(mix(-forward_ws.xyz, eye_ws.xyz - s.position_ws, eye_ws.w));
    float alpha = max(s.roughness * s.roughness, 1e-3);
    vec3 sum = vec3(0.0);
    int first = int(range.x), end = int(range.y);
    for (int i = first; i < end; i++) {
        Vpl vpl = read_vpl(i);
        vec3 d = s.position_ws - vpl.position_ws;
        float d2 = dot(d, d), r2 = vpl.d_min * vpl.d_min;
        vec3 l = -d * inversesqrt(max(d2, 1e-36));
        float cos_theta = -dot(l, vpl.direction_ws), n_l = dot(s.normal_ws, l);
        if (min(min(cos_theta, n_l), dot(s.geometric_normal_ws, l)) <= 0.0) {
            continue;
        }
        float per_intensity = d2 < vpl.near * vpl.near ? patch_irradiance(i, vpl, d, s.normal_ws)
                                                       : cos_theta * n_l / d2;
        float roughness = sqrt(widened_alpha(alpha, r2, d2));
        vec3 f = brdf(base, s.metallic, roughness, s.specular, s.normal_ws, l, v);
        sum += f * vpl.intensity * (per_intensity * vpl_visibility(i, vpl, s));
    }
    o_radiance.rgb += sum;
}
