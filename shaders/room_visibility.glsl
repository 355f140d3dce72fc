#ifdef IN_ROOM
uniform highp sampler2DShadow room; // two texels a pixel's side

// How much of the pixel the room leaves: of the 4 x 4 texels about its middle those before which it does not lie,
// weighed by 1 3 3 1 along either side.
float room_visibility()
{
    vec2 px = 2.0 / vec2(textureSize(room, 0)), at = gl_FragCoord.xy * px, aside = 0.375 * px;
    vec4 about = vec4(at - aside, at + aside);
    float z = gl_FragCoord.z;
    return 0.25 * (texture(room, vec3(about.xy, z)) + texture(room, vec3(about.zy, z)) +
                   texture(room, vec3(about.xw, z)) + texture(room, vec3(about.zw, z)));
}
#else
float room_visibility() { return 1.0; }
#endif
