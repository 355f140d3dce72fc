// Counts how often the graphics driver compiled a shader, where it is Mesa's llvmpipe. The program must export its
// symbols (ENABLE_EXPORTS), so that the driver finds our definition.
#pragma once

// Since the program began. Other drivers do not show it: always 0.
int compiled_shader_count(void);
