#version 300 es
// Vertex of a stroke's quad over an image, at the depth of what the stroke stands for.
precision highp float;

layout(location = 0) in vec4 at;    // x, y in pixels of the image, depth in clip space, the stroke's radius in pixels
layout(location = 1) in vec4 along; // from the stroke's beginning: along and across it; its length; a dash; pixels
layout(location = 2) in vec4 tone;  // straight alpha

uniform vec4 image_size; // width, height, pixels

out vec4 place; // as `along`
out float radius;
out vec4 shade;

void main()
{
    place = along;
    radius = at.w;
    shade = tone;
    gl_Position = vec4(2.0 * (at.xy + 0.5) / image_size.xy - 1.0, at.z, 1.0);
}
