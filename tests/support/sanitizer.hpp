#pragma once

/// 1 where memory belongs to a sanitizer: it reserves much of it, and has an allocator of its own.
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
    #define TESTS_MEMORY_IS_SANITIZED 1
#elif defined(__has_feature)
    #if __has_feature(address_sanitizer) || __has_feature(thread_sanitizer)
        #define TESTS_MEMORY_IS_SANITIZED 1
    #endif
#endif
#ifndef TESTS_MEMORY_IS_SANITIZED
    #define TESTS_MEMORY_IS_SANITIZED 0
#endif

/// 1 where threads are watched for races.
#if defined(__SANITIZE_THREAD__)
    #define TESTS_THREADS_ARE_SANITIZED 1
#elif defined(__has_feature)
    #if __has_feature(thread_sanitizer)
        #define TESTS_THREADS_ARE_SANITIZED 1
    #endif
#endif
#ifndef TESTS_THREADS_ARE_SANITIZED
    #define TESTS_THREADS_ARE_SANITIZED 0
#endif
