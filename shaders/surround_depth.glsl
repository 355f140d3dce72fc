// What a pixel of the surface image holds: 1 / z in units of the nearest z drawn, 24 bits; and which picture it is of,
// from 1; 0: none.
vec4 pack_surface(float inverse_z, float nearest, float picture)
{
    uint n = uint(clamp(inverse_z * nearest, 0.0, 1.0) * 16777215.0 + 0.5);
    return vec4(float(n >> 16), float((n >> 8) & 255u), float(n & 255u), picture + 1.0) / 255.0;
}

float unpack_inverse_z(vec4 kept, float nearest)
{
    vec3 bytes = floor(kept.rgb * 255.0 + 0.5);
    return (bytes.r * 65536.0 + bytes.g * 256.0 + bytes.b) / 16777215.0 / nearest;
}
