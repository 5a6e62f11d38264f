// The sum over VPLs at one pixel, whichever tier it is made in:
//   E(x) = Σ I_v · w · max(0, n·ω) · V_v(x) / max(d, d_min)²,  w = 1 in front of the VPL and
// ½ behind it; for a Lambertian VPL the cosine in front and 0 behind, and near it what its patch gives.

uniform sampler2D s_albedo;

// What receives the light.
struct Receiver {
    Surface s;
    vec3 v;   // unit, to the eye
    vec3 f0;  // reflectance along the normal
    float f90;
    float n_v;
    float alpha;
    bool glossy; // whether it has a glossy lobe that is summed
};

// Which pixel a place within a layer is, for the layer of a place in the n × n.
ivec2 pixel_of(ivec2 in_layer, ivec2 place)
{
    return (in_layer * grid.x + place) * grid.y + grid.y / 2;
}

// False where there is no surface.
bool read_receiver(ivec2 pixel, out Receiver r)
{
    if (any(greaterThanEqual(vec2(pixel), size.xy))) {
        return false;
    }
    r.s = read_surface(pixel);
    if (r.s.depth <= 0.0) {
        return false;
    }
    r.v = normalize(mix(-forward_ws.xyz, eye_ws.xyz - r.s.position_ws, eye_ws.w));
    r.f0 = mix(vec3(0.04 * r.s.specular), texelFetch(s_albedo, pixel, 0).rgb, r.s.metallic);
    r.f90 = mix(r.s.specular, 1.0, r.s.metallic);
    r.n_v = max(abs(dot(r.s.normal_ws, r.v)), 1e-4);
    r.alpha = max(r.s.roughness * r.s.roughness, 1e-3);
    r.glossy = (range.w & 1u) == 1u && r.f90 > 0.0;
    return true;
}

// The VPL at place k of what is summed, and its number. Each tier has its own.
Vpl vpl_at(int k, out int i);

// Adds the VPLs at the places k, k + stride … below `end`.
void add_vpls(Receiver r, int k, int end, int stride, inout vec3 diffuse, inout vec3 specular)
{
    bool far_only = (range.w & 2u) != 0u, near_only = (range.w & 4u) != 0u;
    while (true) {
        // To the next one that gives light: lanes that run together do the rest for as many as one of them needs.
        int i = 0;
        Vpl vpl;
        vec3 d = vec3(0.0);
        float d2 = 0.0, part = 0.0, reciprocal = 0.0, weight = 0.0, cosine = 0.0;
        for (; k < end; k += stride) {
            vpl = vpl_at(k, i);
            d = r.s.position_ws - vpl.position_ws;
            d2 = dot(d, d);
            // A smooth limit: neither part of the sum has an edge that a filter could blur.
            float reach = vpl.reach * vpl.near, inside = clamp(3.0 - 3.0 * d2 / max(reach * reach, 1e-36), 0.0, 1.0);
            part = near_only ? inside : far_only ? 1.0 - inside : 1.0;
            reciprocal = inversesqrt(max(d2, 1e-36));
            float along = dot(d, vpl.direction_ws);
            weight = vpl.lambertian ? along * reciprocal : along >= 0.0 ? 1.0 : 0.5;
            cosine = -dot(r.s.normal_ws, d) * reciprocal;
            // Light from below the surface itself is no light, whatever the shading normal says.
            bool lights = min(min(cosine, weight), min(part, -dot(r.s.geometric_normal_ws, d))) > 0.0;
            if (lights && uint(i) >= range.x && uint(i) < range.y) {
                break;
            }
        }
        if (k >= end) {
            break;
        }
        k += stride;
        float bound2 = vpl.d_min * vpl.d_min;
        float per_intensity = vpl.lambertian && d2 < vpl.near * vpl.near
                                  ? patch_irradiance(i, vpl.direction_ws, d, r.s.normal_ws)
                                  : weight * cosine / max(d2, bound2);
        vec3 e = vpl.intensity * (per_intensity * part * vpl_visibility(i, vpl, r.s));
        if (r.glossy) {
            vec3 l = -d * reciprocal, h = half_vector(l, r.v);
            vec3 F = F_Schlick(r.f0, r.f90, clamp(dot(r.v, h), 0.0, 1.0));
            float wide = widened_alpha(r.alpha, bound2, d2);
            specular += e * F * (D_GGX(r.s.normal_ws, h, wide) * V_SmithGGXCorrelated(cosine, r.n_v, wide));
            e *= 1.0 - F;
        }
        diffuse += e;
    }
}
