// One direction of the filter that shares the sums of the interleaved gather (Segovia et al. 2006): the mean over n + 1
// pixels along the direction, the outer two with half a weight, so that every one of n subsets of the VPLs counts once;
// weighted by how much of the same surface they are.
// Inputs: G-buffer, sums. Outputs: irradiance, W/m², and reflected radiance, W/(m² sr).

uniform sampler2D s_sum;
uniform sampler2D s_sum_specular;

layout(std140) uniform PassBlock {
    ivec4 grid;  // x: n, y: pixels from one that has a sum to the next, zw: size of a layer of sums; 0 if they lie as pixels do
    ivec4 along; // xy: direction; z: 1 where the result is for every pixel, else for those that have sums
    vec4 scale;  // x: factor on the result
};

layout(location = 0) out vec4 o_irradiance;
layout(location = 1) out vec4 o_specular;

void main()
{
    ivec2 at = ivec2(gl_FragCoord.xy), pixels = ivec2(size.xy), cells = (pixels + grid.y - 1) / grid.y;
    ivec2 pixel = along.z == 1 ? at : min(at * grid.y + grid.y / 2, pixels - 1);
    ivec2 cell = along.z == 1 ? at / grid.y : at;
    o_irradiance = vec4(0.0);
    o_specular = vec4(0.0);
    uvec4 texel = texelFetch(s_surface, pixel, 0);
    if (uintBitsToFloat(texel.x) <= 0.0) {
        return;
    }
    vec3 position = read_position(pixel);
    vec3 normal = oct_decode(unpack_pair(texel.y)), plane = oct_decode(unpack_pair(texel.z));
    float footprint = distance(position, eye_ws.xyz) * size.w;
    vec3 diffuse = vec3(0.0), specular = vec3(0.0);
    float total = 0.0;
    int reach = grid.x / 2;
    for (int i = -reach; i <= reach; i++) {
        ivec2 other = cell + along.xy * i;
        if (any(lessThan(other, ivec2(0))) || any(greaterThanEqual(other, cells))) {
            continue;
        }
        ivec2 other_pixel = min(other * grid.y + grid.y / 2, pixels - 1);
        uvec4 other_texel = texelFetch(s_surface, other_pixel, 0);
        if (uintBitsToFloat(other_texel.x) <= 0.0) {
            continue;
        }
        vec3 d = read_position(other_pixel) - position;
        vec3 other_normal = oct_decode(unpack_pair(other_texel.y));
        float off = abs(dot(plane, d)) / (0.05 * length(d) + footprint);
        float weight = pow(max(dot(normal, other_normal), 0.0), 16.0) * exp(-off * off) * (abs(i) == reach ? 0.5 : 1.0);
        ivec2 from = grid.z > 0 ? other / grid.x + (other % grid.x) * grid.zw : other;
        diffuse += weight * texelFetch(s_sum, from, 0).rgb;
        specular += weight * texelFetch(s_sum_specular, from, 0).rgb;
        total += weight;
    }
    float scaled = scale.x / max(total, 1e-6);
    o_irradiance.rgb = diffuse * scaled;
    o_specular.rgb = specular * scaled;
}
