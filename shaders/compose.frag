#version 300 es
// The actor over the camera's picture, pixel for pixel.
precision highp float;
uniform highp sampler2D camera_picture;
uniform highp sampler2D actor_picture; // premultiplied
out vec4 color;
void main()
{
    ivec2 at = ivec2(gl_FragCoord.xy);
    vec4 actor = texelFetch(actor_picture, at, 0);
    color = vec4(texelFetch(camera_picture, at, 0).rgb * (1.0 - actor.a) + actor.rgb, 1.0);
}
