// The sum over the VPLs of a range, every one at every pixel, added to what other ranges gave:
//   E(x) = Σ I_v · w · max(0, n·ω) · V_v(x) / max(d, d_min)²,  w = 1 in front of the VPL and
// ½ behind it; for a Lambertian VPL the cosine in front and 0 behind, and near it what its patch gives.
// Inputs: G-buffer, VPL texture, visibility. Outputs: irradiance, W/m², and with range.w radiance that the glossy lobe
// reflects, W/(m² sr); what that reflects is taken from the irradiance. VPLs in lists may be summed apart: range.w.

uniform sampler2D s_albedo;
uniform sampler2D s_previous;
uniform sampler2D s_previous_specular;

layout(location = 0) out vec4 o_irradiance;
layout(location = 1) out vec4 o_specular;

void main()
{
    ivec2 at = ivec2(gl_FragCoord.xy);
    o_irradiance = texelFetch(s_previous, at, 0);
    o_specular = texelFetch(s_previous_specular, at, 0);
    ivec2 place = at / grid.zw;
    ivec2 pixel = ((at - place * grid.zw) * grid.x + place) * grid.y + grid.y / 2;
    if (any(greaterThanEqual(vec2(pixel), size.xy))) {
        return;
    }
    Surface s = read_surface(pixel);
    if (s.depth <= 0.0) {
        return;
    }
    vec3 v = normalize(mix(-forward_ws.xyz, eye_ws.xyz - s.position_ws, eye_ws.w));
    vec3 f0 = mix(vec3(0.04 * s.specular), texelFetch(s_albedo, pixel, 0).rgb, s.metallic);
    float f90 = mix(s.specular, 1.0, s.metallic), n_v = max(abs(dot(s.normal_ws, v)), 1e-4);
    bool glossy = (range.w & 1u) == 1u && f90 > 0.0;
    float alpha = max(s.roughness * s.roughness, 1e-3);

    vec3 diffuse = vec3(0.0), specular = vec3(0.0);
    bool far_only = (range.w & 2u) != 0u, near_only = (range.w & 4u) != 0u;
    ivec2 places = near_only ? near_range(s.position_ws) : ivec2(range.xy) + ivec2(subset_of(uvec2(place)), 0);
    int k = places.x, stride = int(turn.z);
    while (true) {
        // To the next one that gives light: lanes that run together do the rest for as many as one of them needs.
        int i = 0;
        Vpl vpl;
        vec3 d = vec3(0.0);
        float d2 = 0.0, part = 0.0, reciprocal = 0.0, weight = 0.0, cosine = 0.0;
        for (; k < places.y; k += stride) {
            i = near_only ? near_vpl(k) : k;
            vpl = read_vpl(i);
            d = s.position_ws - vpl.position_ws;
            d2 = dot(d, d);
            // A smooth limit: neither part of the sum has an edge that a filter could blur.
            float reach = vpl.reach * vpl.near, inside = clamp(3.0 - 3.0 * d2 / max(reach * reach, 1e-36), 0.0, 1.0);
            part = near_only ? inside : far_only ? 1.0 - inside : 1.0;
            reciprocal = inversesqrt(max(d2, 1e-36));
            float along = dot(d, vpl.direction_ws);
            weight = vpl.lambertian ? along * reciprocal : along >= 0.0 ? 1.0 : 0.5;
            cosine = -dot(s.normal_ws, d) * reciprocal;
            // Light from below the surface itself is no light, whatever the shading normal says.
            bool lights = min(min(cosine, weight), min(part, -dot(s.geometric_normal_ws, d))) > 0.0;
            if (lights && uint(i) >= range.x && uint(i) < range.y) {
                break;
            }
        }
        if (k >= places.y) {
            break;
        }
        k += stride;
        float bound2 = vpl.d_min * vpl.d_min;
        float per_intensity = vpl.lambertian && d2 < vpl.near * vpl.near
                                  ? patch_irradiance(i, vpl.direction_ws, d, s.normal_ws)
                                  : weight * cosine / max(d2, bound2);
        vec3 e = vpl.intensity * (per_intensity * part * vpl_visibility(i, vpl, s));
        if (glossy) {
            vec3 l = -d * reciprocal, h = half_vector(l, v);
            vec3 F = F_Schlick(f0, f90, clamp(dot(v, h), 0.0, 1.0));
            float wide = widened_alpha(alpha, bound2, d2);
            specular += e * F * (D_GGX(s.normal_ws, h, wide) * V_SmithGGXCorrelated(cosine, n_v, wide));
            e *= 1.0 - F;
        }
        diffuse += e;
    }
    o_irradiance.rgb += diffuse;
    o_specular.rgb += specular;
}
