/* What numba's code asks of its runtime: memory for arrays that a kernel makes and frees, and BLAS, by the pointers
   that SciPy hands out. Layout and names are those of numba's nrt.h and _helperlib.c. */
#define Py_LIMITED_API 0x030B0000
#include <Python.h>
#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

typedef struct {
    size_t references;
    void (*destroy)(void *, size_t, void *);
    void *destroy_info, *data;
    size_t size;
    void *external;
} MemInfo;

void *NRT_MemInfo_alloc_aligned(size_t size, uint32_t align) {
    MemInfo *m = malloc(sizeof(MemInfo) + size + align);
    if (!m) return NULL;
    memset(m, 0, sizeof *m);
    m->references = 1;
    m->size = size;
    m->data = (void *)(((uintptr_t)(m + 1) + align - 1) / align * align);
    return m;
}

void *NRT_MemInfo_alloc(size_t size) { return NRT_MemInfo_alloc_aligned(size, 16); }
void NRT_MemInfo_call_dtor(MemInfo *m) {
    if (m->destroy) m->destroy(m->data, m->size, m->destroy_info);
    free(m);
}

/* Of lists: their memory is apart, since it grows. */
static void free_apart(void *data, size_t size, void *destroy) {
    if (destroy) ((void (*)(void *, size_t, void *))destroy)(data, size, NULL);
    free(data);
}

void *NRT_MemInfo_new_varsize_dtor(size_t size, void *destroy) {
    void *data = malloc(size ? size : 1);
    MemInfo *m = data ? NRT_MemInfo_alloc_aligned(0, 16) : NULL;
    if (!m) { free(data); return NULL; }
    m->data = data;
    m->size = size;
    m->destroy = free_apart;
    m->destroy_info = destroy;
    return m;
}

void *NRT_MemInfo_varsize_realloc(MemInfo *m, size_t size) {
    void *data = realloc(m->data, size);
    if (data) { m->data = data; m->size = size; }
    return data;
}

void *NRT_Allocate(size_t size) { return malloc(size); }
void NRT_Free(void *data) { free(data); }

void numba_fatal_error(void) { Py_FatalError("inercal: a kernel met an error of BLAS that it cannot survive"); }
int numba_gil_ensure(void) { return (int)PyGILState_Ensure(); }

/* Strides of a new shape; 0 where the array does not lie in rows one after the other. */
int numba_attempt_nocopy_reshape(intptr_t axes, const intptr_t *shape, const intptr_t *strides, intptr_t new_axes,
                                 const intptr_t *new_shape, intptr_t *new_strides, intptr_t itemsize, int fortran) {
    intptr_t expected = itemsize;
    if (fortran) return 0;
    for (intptr_t k = axes - 1; k >= 0; k--) {
        if (shape[k] != 1 && strides[k] != expected) return 0;
        expected *= shape[k];
    }
    expected = itemsize;
    for (intptr_t k = new_axes - 1; k >= 0; k--) {
        new_strides[k] = expected;
        expected *= new_shape[k];
    }
    return 1;
}

#if defined(_WIN32)
void sincos(double x, double *s, double *c) { *s = sin(x); *c = cos(x); }
#endif

/* BLAS and LAPACK, of float64 alone; called without the GIL. */
#if defined(__GNUC__)
__attribute__((visibility("hidden")))
#endif
void *scipy_function(const char *module, const char *name);
#define BLAS "scipy.linalg.cython_blas"
#define LAPACK "scipy.linalg.cython_lapack"
#define FUNCTION(type, module, name) \
    static type f; \
    if (kind != 'd') return -1; \
    if (!f) f = (type)scipy_function(module, name)

int numba_xxgemm(char kind, char ta, char tb, intptr_t m, intptr_t n, intptr_t k, void *alpha, void *a, intptr_t lda,
                 void *b, intptr_t ldb, void *beta, void *c, intptr_t ldc) {
    typedef void (*Gemm)(char *, char *, int *, int *, int *, void *, void *, int *, void *, int *, void *, void *, int *);
    FUNCTION(Gemm, BLAS, "dgemm");
    int M = (int)m, N = (int)n, K = (int)k, A = (int)lda, B = (int)ldb, C = (int)ldc;
    f(&ta, &tb, &M, &N, &K, alpha, a, &A, b, &B, beta, c, &C);
    return 0;
}

int numba_xxgemv(char kind, char t, intptr_t m, intptr_t n, void *alpha, void *a, intptr_t lda, void *x, void *beta,
                 void *y) {
    typedef void (*Gemv)(char *, int *, int *, void *, void *, int *, void *, int *, void *, void *, int *);
    FUNCTION(Gemv, BLAS, "dgemv");
    int M = (int)m, N = (int)n, A = (int)lda, one = 1;
    f(&t, &M, &N, alpha, a, &A, x, &one, beta, y, &one);
    return 0;
}

int numba_xxdot(char kind, char conjugated, intptr_t n, void *x, void *y, void *out) {
    typedef double (*Dot)(int *, double *, int *, double *, int *);
    FUNCTION(Dot, BLAS, "ddot");
    int N = (int)n, one = 1;
    (void)conjugated;
    *(double *)out = f(&N, x, &one, y, &one);
    return 0;
}

int numba_ez_gesdd(char kind, char job, intptr_t m, intptr_t n, void *a, intptr_t lda, void *s, void *u, intptr_t ldu,
                   void *vt, intptr_t ldvt) {
    typedef void (*Gesdd)(char *, int *, int *, void *, int *, void *, void *, int *, void *, int *, void *, int *, int *,
                          int *);
    FUNCTION(Gesdd, LAPACK, "dgesdd");
    int M = (int)m, N = (int)n, A = (int)lda, U = (int)ldu, VT = (int)ldvt, size = -1, info = 0;
    int *whole = malloc((size_t)(8 * (M < N ? M : N) + 1) * sizeof(int));
    double best = 0.0, *work = NULL;
    if (whole) f(&job, &M, &N, a, &A, s, u, &U, vt, &VT, &best, &size, whole, &info);
    if (whole && info == 0 && (work = malloc((size_t)(size = (int)best) * sizeof(double))))
        f(&job, &M, &N, a, &A, s, u, &U, vt, &VT, work, &size, whole, &info);
    else if (info == 0) info = -1;
    free(work);
    free(whole);
    return info;
}

int numba_ez_xxxevd(char kind, char job, char triangle, intptr_t n, void *a, intptr_t lda, void *w) {
    typedef void (*Syevd)(char *, char *, int *, void *, int *, void *, void *, int *, int *, int *, int *);
    FUNCTION(Syevd, LAPACK, "dsyevd");
    int N = (int)n, A = (int)lda, size = -1, integers = -1, most = 0, info = 0, *whole = NULL;
    double best = 0.0, *work = NULL;
    f(&job, &triangle, &N, a, &A, w, &best, &size, &most, &integers, &info);
    size = (int)best;
    integers = most;
    if (info == 0 && (work = malloc((size_t)size * sizeof(double))) && (whole = malloc((size_t)integers * sizeof(int))))
        f(&job, &triangle, &N, a, &A, w, work, &size, whole, &integers, &info);
    else if (info == 0) info = -1;
    free(work);
    free(whole);
    return info;
}
