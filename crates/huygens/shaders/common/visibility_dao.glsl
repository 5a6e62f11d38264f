// Directional ambient occlusion (Yu et al. 2009): a VPL is hidden where its direction lies below the horizon of the
// pass `ao` in its azimuth.

uniform highp usampler2D s_horizons;

float horizon_sine(uvec4 horizons, int k)
{
    uint four = horizons[(k / 4) % 4];
    return float((four >> (8 * (k % 4))) & 0xffu) / 255.0;
}

float vpl_visibility(int index, Vpl vpl, Surface s)
{
    uvec4 horizons = texelFetch(s_horizons, s.pixel, 0);
    vec3 l = normalize(vpl.position_ws - s.position_ws);
    // Where a step toward the VPL goes on the screen, but for a positive factor.
    vec3 position_vs = (view_from_world * vec4(s.position_ws, 1.0)).xyz, l_vs = (view_from_world * vec4(l, 0.0)).xyz;
    vec2 on_screen = mix(l_vs.xy, l_vs.xy * -position_vs.z + position_vs.xy * l_vs.z, eye_ws.w);
    float k = azimuth_number(on_screen);
    float sine = mix(horizon_sine(horizons, int(k)), horizon_sine(horizons, int(k) + 1), fract(k));
    // Horizons are measured from the plane of the shading normal. Between two directions they are only near: a ramp
    // instead of an edge, below it, so that what lies on an open plane sees all.
    return clamp((dot(l, s.normal_ws) - sine) * 10.0 + 1.0, 0.0, 1.0);
}
