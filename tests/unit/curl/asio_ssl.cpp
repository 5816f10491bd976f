// What Asio with TLS is made of, once.
#include <asio/ssl/impl/src.hpp>
