// Loaded before a program (LD_PRELOAD): its first graphics context is lost after CHECKS queries; with the second
// context the program gets SIGTERM, which ends it as Ctrl-C does, after as many again.
#include <dlfcn.h>
#include <signal.h>
#include <string.h>

enum { CHECKS = 150, LOST = 0x8253 }; // GL_GUILTY_CONTEXT_RESET

static int contexts, checks; // contexts that enabled reset notification; queries of the present one

static unsigned reset_status(void)
{
    checks++;
    if (contexts == 2 && checks == CHECKS)
        raise(SIGTERM);
    return contexts == 1 && checks >= CHECKS ? LOST : 0;
}

typedef void procedure(void);
procedure *eglGetProcAddress(const char *name);

procedure *eglGetProcAddress(const char *name)
{
    procedure *(*real)(const char *);
    *(void **)&real = dlsym(RTLD_NEXT, "eglGetProcAddress");
    if (strncmp(name, "glGetGraphicsResetStatus", 24))
        return real(name);
    contexts++;
    checks = 0;
    return (procedure *)reset_status;
}
