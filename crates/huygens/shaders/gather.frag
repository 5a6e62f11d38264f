// Irradiance from the VPLs of a range, every one at every pixel, added to what other ranges gave:
//   E(x) = Σ I_v · w · max(0, n·ω) · V_v(x) / max(d, d_min)²,  w = 1 in front of the VPL and
// ½ behind it; for a Lambertian VPL the cosine in front and 0 behind.
// Inputs: G-buffer, VPL texture, visibility. Output: irradiance, W/m².

uniform sampler2D s_previous;

layout(location = 0) out vec4 o_irradiance;

void main()
{
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    o_irradiance = texelFetch(s_previous, pixel, 0);
    Surface s = read_surface(pixel);
    if (s.depth <= 0.0) {
        return;
    }
    vec3 sum = vec3(0.0);
    int first = int(range.x), end = first + int(range.y);
    for (int i = first; i < end; i++) {
        Vpl vpl = read_vpl(i);
        vec3 d = s.position_ws - vpl.position_ws;
        float d2 = dot(d, d);
        float reciprocal = inversesqrt(max(d2, 1e-36)), along = dot(d, vpl.direction_ws);
        float weight = vpl.lambertian ? along * reciprocal : along >= 0.0 ? 1.0 : 0.5;
        float cosine = -dot(s.normal_ws, d) * reciprocal;
        if (min(cosine, weight) <= 0.0) {
            continue;
        }
        float visibility = vpl_visibility(i, vpl.position_ws, s.position_ws, s.geometric_normal_ws);
        sum += vpl.intensity * (weight * cosine * visibility / max(d2, vpl.d_min * vpl.d_min));
    }
    o_irradiance.rgb += sum;
}
