#ifdef REENACT_FFMPEG
#include "platform/files/ffmpeg_library.h"

#include "base/status.h"

#include <dlfcn.h>
#include <pthread.h>
#include <string.h>

#define SONAME(name, major) "lib" name ".so." AV_STRINGIFY(major)

static struct ffmpeg_library library;
static bool loaded;

static void load_functions(void)
{
    // libavformat brings libavcodec and libavutil.
    void *const from[] = {dlopen(SONAME("avformat", LIBAVFORMAT_VERSION_MAJOR), RTLD_NOW | RTLD_LOCAL),
                          dlopen(SONAME("swscale", LIBSWSCALE_VERSION_MAJOR), RTLD_NOW | RTLD_LOCAL)};
    static const struct {
        const char *name;
        size_t at;
    } functions[] = {
#define ENTRY(name) {#name, offsetof(struct ffmpeg_library, name)},
        FFMPEG_FUNCTIONS(ENTRY)
#undef ENTRY
    };
    loaded = from[0] && from[1];
    for (size_t i = 0; i < COUNT_OF(functions) && loaded; i++) {
        void *const found = dlsym(from[!strncmp(functions[i].name, "sws_", 4)], functions[i].name);
        memcpy((char *)&library + functions[i].at, &found, sizeof found); // ISO C converts no object's pointer
        loaded = found != NULL;
    }
    if (loaded)
        library.av_log_set_level(AV_LOG_QUIET); // what is wrong is said once, by us
}

const struct ffmpeg_library *ffmpeg_library(void)
{
    static pthread_once_t once = PTHREAD_ONCE_INIT;
    pthread_once(&once, load_functions);
    return loaded ? &library : NULL;
}
#endif
