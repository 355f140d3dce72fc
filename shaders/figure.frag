#version 300 es
// The person's figure: where the shown frame itself saw this place, squarely and
// near enough, its own colours; elsewhere those gathered over the take; and
// smoothly from the one to the other.
precision highp float;

in vec4 place;
in vec4 seen;
in vec2 lighting;

uniform highp sampler2D atlas;       // colours in the mean light
uniform highp sampler2D now_picture;
uniform highp sampler2D now_depth;   // millimetres (high, low byte); blue: 0 at the person's edge and elsewhere,
                                     // 1 well within

out vec4 color; // premultiplied

#ifdef IN_ROOM
uniform vec4 view_lens[3];            // as figure.vert has it
uniform highp sampler2DShadow room;   // two texels a pixel's side

// How much of the pixel the room leaves: of the 4 x 4 texels about its middle those before which it does not lie,
// weighed by 1 3 3 1 along either side.
float left_by_room()
{
    vec2 px = 1.0 / view_lens[2].zw, at = gl_FragCoord.xy * px, aside = 0.375 * px;
    vec4 about = vec4(at - aside, at + aside);
    float z = gl_FragCoord.z;
    return 0.25 * (texture(room, vec3(about.xy, z)) + texture(room, vec3(about.zy, z)) +
                   texture(room, vec3(about.xw, z)) + texture(room, vec3(about.zw, z)));
}
#else
float left_by_room() { return 1.0; }
#endif

void main()
{
    vec3 own = texture(atlas, place.xy).rgb * lighting.x;
    vec4 there = texture(now_depth, seen.xy);
    float off = abs((there.r * 256.0 + there.g) * 0.255 - seen.z);
    float now = seen.w * there.b * (1.0 - smoothstep(0.05, 0.09, off));
    color = left_by_room() * vec4(mix(own, texture(now_picture, place.zw).rgb, now), 1.0);
}
