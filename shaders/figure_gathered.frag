#version 300 es
// The person's figure in the colours gathered over the take: the triangles that have nothing of the shown frame's own,
// and the ribbon along the outline, which fades outwards, for what a frame itself saw at its outline is half the room.
precision highp float;

in vec4 place;
in vec2 lighting;

uniform highp sampler2D atlas; // colours in the mean light

out vec4 color; // premultiplied

#ifdef IN_ROOM
uniform vec4 view_lens[3];            // as figure.vert has it
uniform highp sampler2DShadow room;   // two texels a pixel's side

// As figure.frag has it.
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
    color = left_by_room() * lighting.y * vec4(texture(atlas, place.xy).rgb * lighting.x, 1.0);
}
