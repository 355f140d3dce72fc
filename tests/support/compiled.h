// How often the graphics driver compiled a shader, where it is Mesa's llvmpipe. Whoever asks has to export its symbols
// (ENABLE_EXPORTS), for the driver has to find ours.
#pragma once

// Since the program began. Other drivers tell nothing: always 0.
int compiled_shader_count(void);
