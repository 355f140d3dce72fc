#version 300 es
// One triangle over the whole target.
precision highp float;
layout(location = 0) in vec2 corner;
void main()
{
    gl_Position = vec4(corner, 0.0, 1.0);
}
