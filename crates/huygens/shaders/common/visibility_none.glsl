// Every surface sees every VPL.
float vpl_visibility(int index, Vpl vpl, Surface s)
{
    return 1.0;
}
