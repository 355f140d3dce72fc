#ifdef ROOM_OCCLUSION
uniform highp sampler2DShadow room; // the occluder mesh's depth, two texels along a pixel's side

// Share of the pixel about `at` that the room does not hide at depth z: percentage-closer filtering over the 4 x 4
// texels about its centre, weights 1 3 3 1 along each axis.
float room_visibility_at(vec2 at_px, float z)
{
    vec2 px = 2.0 / vec2(textureSize(room, 0)), at = at_px * px, offset = 0.375 * px;
    vec4 taps = vec4(at - offset, at + offset);
    return 0.25 * (texture(room, vec3(taps.xy, z)) + texture(room, vec3(taps.zy, z)) +
                   texture(room, vec3(taps.xw, z)) + texture(room, vec3(taps.zw, z)));
}
#else
float room_visibility_at(vec2 at_px, float z) { return 1.0; }
#endif

float room_visibility() { return room_visibility_at(gl_FragCoord.xy, gl_FragCoord.z); }
