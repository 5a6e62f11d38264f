// The sum over the VPLs of a range at every pixel, with near_cells.w added to what other ranges gave, as gather.frag has it: see
// common/gather_range.glsl. The pixels of a workgroup lie side by side in a layer, so that all of them sum the same subset
// of the VPLs: the workgroup reads it once, a batch at a time, into shared memory.
// Inputs: G-buffer, VPL texture, visibility. Outputs: irradiance, W/m², and with range.w radiance that the
// glossy lobe reflects, W/(m² sr); what that reflects is taken from the irradiance.

layout(local_size_x = 8, local_size_y = 8) in;

layout(rgba32f, binding = 0) uniform image2D i_irradiance;
layout(rgba32f, binding = 1) uniform image2D i_specular;

// VPLs of a batch: 6 KiB, so that shared memory does not limit how many workgroups run at a time.
const int BATCH = 128;

shared vec4 batch_position[BATCH];
shared vec4 batch_direction[BATCH];
shared vec4 batch_intensity[BATCH];

// Number of the first VPL of the batch, and from one to the next.
int batch_first = 0, batch_stride = 1;

Vpl vpl_at(int k, out int i)
{
    i = batch_first + k * batch_stride;
    return unpack_vpl(batch_position[k], batch_direction[k], batch_intensity[k]);
}

void main()
{
    ivec2 place = ivec2(int(gl_WorkGroupID.z) % grid.x, int(gl_WorkGroupID.z) / grid.x);
    ivec2 in_layer = ivec2(gl_GlobalInvocationID.xy), at = in_layer + place * grid.zw;
    Receiver r;
    bool lit = all(lessThan(in_layer, grid.zw)) && read_receiver(pixel_of(in_layer, place), r);
    vec3 diffuse = vec3(0.0), specular = vec3(0.0);
    batch_stride = int(turn.z);
    batch_first = int(range.x) + subset_of(uvec2(place));
    // The same for all of the workgroup, so that all of it comes to the barriers.
    for (; batch_first < int(range.y); batch_first += BATCH * batch_stride) {
        int count = min(BATCH, (int(range.y) - batch_first + batch_stride - 1) / batch_stride);
        for (int k = int(gl_LocalInvocationIndex); k < count; k += 64) {
            ivec2 texel = vpl_texel(batch_first + k * batch_stride);
            batch_position[k] = texelFetch(s_vpl, texel, 0);
            batch_direction[k] = texelFetch(s_vpl, texel + ivec2(1, 0), 0);
            batch_intensity[k] = texelFetch(s_vpl, texel + ivec2(2, 0), 0);
        }
        barrier();
        if (lit) {
            add_vpls(r, 0, count, 1, diffuse, specular);
        }
        barrier();
    }
    if (all(lessThan(in_layer, grid.zw)) && (lit || near_cells.w == 0)) {
        vec4 irradiance = vec4(diffuse, 0.0), reflected = vec4(specular, 0.0);
        if (near_cells.w != 0) {
            irradiance += imageLoad(i_irradiance, at);
            reflected += imageLoad(i_specular, at);
        }
        imageStore(i_irradiance, at, irradiance);
        imageStore(i_specular, at, reflected);
    }
}
