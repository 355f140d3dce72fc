#include "tests/support/compiled.h"

#include <dlfcn.h>
#include <stdatomic.h>

static atomic_int compiled;

int compiled_shader_count(void) { return atomic_load(&compiled); }

// LLVM's function, interposed. llvmpipe makes one module for each variant of each shader, and the dynamic linker
// prefers the program's own definition to the library's.
void *LLVMModuleCreateWithNameInContext(const char *name, void *context);

void *LLVMModuleCreateWithNameInContext(const char *name, void *context)
{
    void *(*real)(const char *, void *);
    *(void **)&real = dlsym(RTLD_NEXT, "LLVMModuleCreateWithNameInContext");
    atomic_fetch_add(&compiled, 1);
    return real(name, context);
}
