// Direct visibility from a cube shadow map in light space, by percentage closer filtering (Reeves et al. 1987).

uniform highp samplerCubeShadow s_shadow;

// Share of the texels within the filter's box that see the light, 0…1. Each is compared with the receiver's own plane
// where the ray through the texel's centre meets it, which is what the map would hold there: the plane cannot shadow
// itself, and shadows end where they should.
float light_visibility(vec3 position_ws, vec3 normal_ws)
{
    vec3 p = (light_from_world * vec4(position_ws, 1.0)).xyz;
    vec3 n = mat3(light_from_world) * normal_ws;
    vec3 middle = receiver_center(p, n, shadow.y * (shadow.z + 0.7));
    vec3 a = abs(middle);
    float far_side = max(a.x, max(a.y, a.z));
    vec3 axis = a.x >= far_side ? vec3(1.0, 0.0, 0.0) : a.y >= far_side ? vec3(0.0, 1.0, 0.0) : vec3(0.0, 0.0, 1.0);
    vec3 u = axis.yzx, v = axis.zxy, face = axis * sign(dot(middle, axis));
    // In texels from a corner of the face.
    vec2 at = (vec2(dot(middle, u), dot(middle, v)) / far_side + 1.0) / shadow.y;
    vec2 first = floor(at - shadow.z) + 0.5;
    int count = int(ceil(2.0 * shadow.z + 1.0));
    float lit = 0.0, total = 0.0;
    for (int y = 0; y < count; y++) {
        for (int x = 0; x < count; x++) {
            vec2 center = first + vec2(x, y);
            vec2 inside = clamp(shadow.z + 0.5 - abs(center - at), 1e-6, 1.0);
            vec2 c = center * shadow.y - 1.0;
            vec3 ray = face + u * c.x + v * c.y;
            float reference = receiver_distance(p, n, normalize(ray)) * shadow.x;
            lit += inside.x * inside.y * texture(s_shadow, vec4(ray, reference));
            total += inside.x * inside.y;
        }
    }
    return lit / total;
}
