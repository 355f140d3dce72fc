#version 300 es
// Which picture's surface is in front, and how far.
precision highp float;
precision highp int;

in float inverse;
in float through;

uniform vec4 view_range; // width, height, nearest z drawn
uniform vec4 order;      // of this picture

out vec4 kept;

#include "surround_depth.glsl"

const float MOST_THROUGH = 0.75; // as in view_merge.c

void main()
{
    if (through > MOST_THROUGH) // where no other surface is, nothing has been seen
        discard;
    kept = pack_surface(inverse * gl_FragCoord.w, view_range.z, order.x);
}
