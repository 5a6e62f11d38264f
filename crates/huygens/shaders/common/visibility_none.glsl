// Every surface sees every VPL.
float vpl_visibility(int index, Vpl vpl, vec3 position_ws, vec3 normal_ws)
{
    return 1.0;
}
