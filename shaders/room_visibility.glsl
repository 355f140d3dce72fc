#ifdef ROOM_OCCLUSION
uniform highp sampler2DShadow room; // the occluder mesh's depth, two texels along a pixel's side

// Share of the pixel that the room does not hide: percentage-closer filtering over the 4 x 4 texels about its centre,
// weights 1 3 3 1 along each axis.
float room_visibility()
{
    vec2 px = 2.0 / vec2(textureSize(room, 0)), at = gl_FragCoord.xy * px, offset = 0.375 * px;
    vec4 taps = vec4(at - offset, at + offset);
    float z = gl_FragCoord.z;
    return 0.25 * (texture(room, vec3(taps.xy, z)) + texture(room, vec3(taps.zy, z)) +
                   texture(room, vec3(taps.xw, z)) + texture(room, vec3(taps.zw, z)));
}
#else
float room_visibility() { return 1.0; }
#endif
