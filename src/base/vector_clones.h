#pragma once
/// CNERF_VECTOR_CLONES: a function of loops that become vector instructions, compiled for several processors. The one
/// it runs on is found when the program starts. Its results are the same on all where the file is compiled without
/// contraction and sums have an order of their own.

#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__) && !defined(__SANITIZE_ADDRESS__) && \
    !defined(__SANITIZE_THREAD__)
#define CNERF_VECTOR_CLONES __attribute__((target_clones("default", "avx2", "avx512f")))
#else  // sanitizers are not ready yet when functions are chosen
#define CNERF_VECTOR_CLONES
#endif
