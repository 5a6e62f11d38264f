// Horizons around a pixel and what they leave open (Bavoil & Sainz 2008, "Image-space horizon-based ambient occlusion";
// integral over the horizons: Jimenez et al. 2016, "Practical real-time strategies for accurate indirect occlusion"):
//   A = 1/π Σ_slices Δφ |n_φ| ∫ max(0, cos(θ − γ)) |sin θ| dθ  between the slice's two horizons.
// A horizon is measured from the plane of the shading normal; flat surfaces that have their own normal never occlude
// themselves, wherever pixels happen to lie.
// Input: G-buffer. Outputs: horizons (16 of 8 bits: the sine of the highest elevation of a surface within the radius,
// 0…1), ambient visibility A, 0…1.

layout(std140) uniform PassBlock {
    vec4 ao; // x: radius, m; y: pixels that 1 m at a distance of 1 m covers (parallel: 1 m); z: largest radius, pixels
};

layout(location = 0) out uvec4 o_horizons;
layout(location = 1) out vec4 o_ambient;

const int STEPS = 24;

// Integral of a slice's side from the viewer to the horizon h, both seen from the projected normal at γ.
float side(float h, float gamma)
{
    return 0.25 * (cos(gamma) + 2.0 * h * sin(gamma) - cos(2.0 * h - gamma));
}

// The vector at right angles to the viewer's direction v in the plane of the slice along a direction on the screen.
vec3 across_view(vec2 along, vec3 v)
{
    vec3 next = (world_from_view * vec4(along, 0.0, 0.0)).xyz;
    return normalize(next - v * dot(next, v));
}

void main()
{
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    Surface s = read_surface(pixel);
    o_horizons = uvec4(0u);
    o_ambient = vec4(1.0);
    if (s.depth <= 0.0) {
        return;
    }
    vec3 v = normalize(mix(-forward_ws.xyz, eye_ws.xyz - s.position_ws, eye_ws.w));
    float radius = min(ao.x * ao.y / mix(1.0, s.depth, eye_ws.w), ao.z);

    // A pattern of 4 × 4 pixels in which each starts at another part of a step: no rings around edges.
    int cell = ((pixel.x & 3) * 4 + (pixel.y & 3)) * 7;
    float start = (float(cell & 15) + 0.5) / 16.0;
    float sines[DIRECTIONS];
    for (int k = 0; k < DIRECTIONS; k++) {
        vec2 along = azimuth_direction(float(k));
        float highest = 0.0;
        for (int j = 0; j < STEPS; j++) {
            // Near samples close together, each at least a pixel further out.
            float share = (float(j) + start) / float(STEPS);
            ivec2 at = ivec2(floor(gl_FragCoord.xy + along * max(share * share * radius, float(j) + 1.0)));
            if (any(lessThan(at, ivec2(0))) || any(greaterThanEqual(at, ivec2(size.xy)))) {
                break;
            }
            vec3 d = read_position(at) - s.position_ws;
            float d2 = dot(d, d);
            // Surfaces toward the radius count less and less, so that none comes and goes at once.
            float near = clamp((ao.x - sqrt(d2)) / (0.25 * ao.x), 0.0, 1.0);
            if (near > 0.0 && d2 > 0.0 && read_depth(at) > 0.0) {
                highest = max(highest, near * dot(d, s.normal_ws) * inversesqrt(d2));
            }
        }
        sines[k] = highest;
    }
    uvec4 packed_horizons = uvec4(0u);
    for (int i = 0; i < 4; i++) {
        packed_horizons[i] = pack_four(vec4(sines[4 * i], sines[4 * i + 1], sines[4 * i + 2], sines[4 * i + 3]));
    }
    o_horizons = packed_horizons;

    float sum = 0.0, whole = 0.0;
    for (int k = 0; k < DIRECTIONS / 2; k++) {
        vec2 along = azimuth_direction(float(k));
        vec3 across = across_view(along, v);
        vec3 slice = cross(across, v);
        vec3 projected = s.normal_ws - slice * dot(s.normal_ws, slice);
        float length_n = length(projected);
        float cosine = clamp(dot(projected, v) / max(length_n, 1e-6), -1.0, 1.0);
        float gamma = acos(cosine) * (dot(across, projected) < 0.0 ? -1.0 : 1.0);
        // Where the slice, which need not hold the normal, is that high above the surface.
        float above = gamma + acos(clamp(sines[k] / max(length_n, 1e-6), 0.0, 1.0));
        float below = gamma - acos(clamp(sines[k + DIRECTIONS / 2] / max(length_n, 1e-6), 0.0, 1.0));
        // The directions are not spread evenly: each slice stands for the angle about v half-way to its neighbours.
        vec3 first = across_view(azimuth_direction(float(k) - 0.5), v);
        vec3 last = across_view(azimuth_direction(float(k) + 0.5), v);
        float width = acos(clamp(dot(first, last), -1.0, 1.0));
        sum += width * length_n * (side(above, gamma) + side(below, gamma));
        // What the slices would have without any horizon: all together π but for there being few of them.
        whole += width * length_n * (side(gamma + 0.5 * PI, gamma) + side(gamma - 0.5 * PI, gamma));
    }
    o_ambient = vec4(clamp(sum / max(whole, 1e-6), 0.0, 1.0));
}
