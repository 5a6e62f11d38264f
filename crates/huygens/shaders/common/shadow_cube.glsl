// Direct visibility from a cube shadow map in light space, by percentage closer filtering (Reeves et al. 1987).

uniform highp samplerCubeShadow s_shadow;

// Share of the filter's taps that see the light, 0…1. The receiver is moved along its geometric normal by
// d · δ · sin ϑ, where δ is the widest angle between the receiver and a texel that a tap reads and ϑ the angle of incidence:
// on a plane that is exactly what keeps every tap from shadowing the plane itself, and no more.
float light_visibility(vec3 position_ws, vec3 normal_ws)
{
    vec3 to_light = light_position.xyz - position_ws;
    float d = length(to_light);
    float cosine = dot(normal_ws, to_light) / d;
    float delta = shadow.y * (shadow.z + 1.4143);
    float offset = d * (delta * sqrt(max(1.0 - cosine * cosine, 0.0)) + 2e-5);
    vec3 receiver_ls = (light_from_world * vec4(position_ws + normal_ws * offset, 1.0)).xyz;
    float reference = length(receiver_ls) * shadow.x;

    // A disc of taps across the ray (Vogel's spiral).
    vec3 axis = normalize(receiver_ls);
    vec3 helper = abs(axis.z) < 0.7 ? vec3(0.0, 0.0, 1.0) : vec3(1.0, 0.0, 0.0);
    vec3 u = normalize(cross(helper, axis)), v = cross(axis, u);
    float radius = shadow.y * shadow.z;
    float lit = 0.0;
    for (int i = 0; i < 16; i++) {
        float r = radius * sqrt((float(i) + 0.5) / 16.0), a = float(i) * 2.39996323;
        lit += texture(s_shadow, vec4(axis + (u * cos(a) + v * sin(a)) * r, reference));
    }
    return lit / 16.0;
}
