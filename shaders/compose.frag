#version 300 es
// The actor and his shadow over the camera's picture, pixel for pixel.
precision highp float;
uniform highp sampler2D camera_picture;
uniform highp sampler2D actor_picture;  // premultiplied
uniform highp sampler2D shadow_picture; // likewise; of one pixel where there is none
out vec4 color;
void main()
{
    ivec2 at = ivec2(gl_FragCoord.xy);
    vec4 actor = texelFetch(actor_picture, at, 0);
    float shadow = texelFetch(shadow_picture, min(at, textureSize(shadow_picture, 0) - 1), 0).a;
    color = vec4(texelFetch(camera_picture, at, 0).rgb * (1.0 - shadow) * (1.0 - actor.a) + actor.rgb, 1.0);
}
