// The terms of the sum over VPLs at one pixel, whichever tier it is made in:
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

// Which pixel a place within a layer is, for the layer of a place in the n × n. Where one of 2 × 2 takes part, the last of
// an odd number stands for itself.
ivec2 pixel_of(ivec2 in_layer, ivec2 place)
{
    ivec2 first = (in_layer * grid.x + place) * grid.y, last = ivec2(size.xy) - 1;
    return all(lessThanEqual(first, last)) ? min(first + (grid.y >> 1), last) : first;
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
    r.f0 = mix(vec3(0.04 * r.s.specular), texel_at(s_albedo, pixel, size.zw).rgb, r.s.metallic);
    r.f90 = mix(r.s.specular, 1.0, r.s.metallic);
    r.n_v = max(abs(dot(r.s.normal_ws, r.v)), 1e-4);
    r.alpha = max(r.s.roughness * r.s.roughness, 1e-3);
    r.glossy = (range.w & 1u) == 1u && r.f90 > 0.0;
    return true;
}

// What one VPL gives to a receiver, but for its visibility.
struct Term {
    int i; // the VPL's number
    Vpl vpl;
    vec3 d; // from the VPL, m
    float d2;
    float reciprocal; // of the distance, 1/m
    float cosine;     // at the receiver
    float weight;     // of the intensity, what goes that way
    float part;       // of it, what is summed
    bool above;       // whether it is above the receiver's surface; else parts of its rectangle are
    bool faces;       // and whether above the horizon of the shading normal, too
    bool lights;
};

// How much of a VPL is summed. `inside` falls from 1 to 0 where it ceases to be near.
float part_of(float inside);

bool is_rectangle(Term t)
{
    return t.d2 < t.vpl.near * t.vpl.near;
}

Term term_of(Receiver r, int i, Vpl vpl)
{
    Term t;
    t.i = i;
    t.vpl = vpl;
    t.d = r.s.position_ws - t.vpl.position_ws;
    t.d2 = dot(t.d, t.d);
    t.reciprocal = inversesqrt(max(t.d2, 1e-36));
    // A smooth limit: neither part of the sum has an edge that a filter could blur.
    float inside = clamp(3.0 - 3.0 * t.d2 / max(t.vpl.reach * t.vpl.reach, 1e-36), 0.0, 1.0);
    t.part = part_of(inside);
    float along = dot(t.d, t.vpl.direction_ws);
    t.weight = t.vpl.lambertian ? along * t.reciprocal : along >= 0.0 ? 1.0 : 0.5;
    t.cosine = -dot(r.s.normal_ws, t.d) * t.reciprocal;
    // Light from below the surface itself is no light, whatever the shading normal says. But a rectangle whose middle is
    // there may reach above; it has no corner farther away than this, and one in the receiver's own plane is before it
    // by rounding alone.
    float geometric = dot(r.s.geometric_normal_ws, t.d), height = -max(dot(r.s.normal_ws, t.d), geometric);
    t.above = geometric < 0.0;
    t.faces = height > 0.0;
    bool reaches = is_rectangle(t) && height > -0.3125 * t.vpl.near && along > 1e-3 * t.vpl.near;
    t.lights = min(t.weight, t.part) > 0.0 && (t.faces || reaches);
    return t;
}

// Irradiance, W/m², for an intensity of 1 W/sr along the VPL's direction.
float rectangle_irradiance(Receiver r, Term t)
{
    return patch_irradiance(t.i, t.vpl, t.d, t.above ? r.s.normal_ws : r.s.geometric_normal_ws);
}

float point_irradiance(Term t)
{
    return t.weight * t.cosine / max(t.d2, t.vpl.d_min * t.vpl.d_min);
}

// Adds one, with one of these. What of a rectangle is above the surface is seen where its middle is not: what is between
// that and the receiver is the receiver's own surface.
void add_term(Receiver r, Term t, float per_intensity, inout vec3 diffuse, inout vec3 specular)
{
    vec3 e = t.vpl.intensity * (per_intensity * t.part * (t.above ? vpl_visibility(t.i, t.vpl, r.s) : 1.0));
    if (r.glossy && t.faces) {
        vec3 l = -t.d * t.reciprocal, h = half_vector(l, r.v);
        vec3 F = F_Schlick(r.f0, r.f90, clamp(dot(r.v, h), 0.0, 1.0));
        float bound2 = t.vpl.d_min * t.vpl.d_min, wide = widened_alpha(r.alpha, bound2, t.d2);
        float lobe = D_GGX(r.s.normal_ws, h, wide) * V_SmithGGXCorrelated(t.cosine, r.n_v, wide);
        // What is reflected of a disc is no brighter than the disc, I / (π d_min²).
        specular += e * F * min(lobe, 1.0 / max(PI * bound2 * per_intensity, 1e-36));
        e *= 1.0 - F;
    }
    diffuse += e;
}

// The lowest bit that is set in what is not 0.
int lowest_bit(uint bits)
{
    return int(floatBitsToUint(float(bits & (~bits + 1u))) >> 23) - 127;
}
