/* What the NDK's crtbegin_so.o gives a shared library, and no more. */

__attribute__((visibility("hidden"))) void *__dso_handle = &__dso_handle;

extern void __cxa_finalize(void *);
extern int __cxa_atexit(void (*)(void *), void *, void *);

__attribute__((destructor)) static void on_unload(void) { __cxa_finalize(&__dso_handle); }

static void call(void *function) { ((void (*)(void))function)(); }

__attribute__((visibility("hidden"))) int atexit(void (*function)(void)) {
    return __cxa_atexit(call, (void *)function, &__dso_handle);
}

/* The API level that the library is built for, where the system looks for it. */
__attribute__((section(".note.android.ident"), used, aligned(4))) static const struct {
    int name_size, content_size, kind;
    char name[8];
    int api_level;
} note = {8, 4, 1, "Android", API_LEVEL};
