#include "sockets.hpp"

#include <support/catch.hpp>

#include <atomic>
#include <csignal>

#include <pthread.h>

namespace sockets_test {

TEST_CASE("sockets: signals that interrupt the loop's calls lose and repeat nothing") {
    struct sigaction quiet {};
    struct sigaction before {};
    quiet.sa_handler = [](int) {}; // without SA_RESTART
    ::sigaction(SIGUSR2, &quiet, &before);
    for (bool own : {true, false})
        for (bool tcp : {true, false}) {
            INFO(own << tcp);
            place at(own);
            auto two = at.run(connected(at, endpoint_of(tcp)));
            auto self = [](ise::loop&) -> task<pthread_t> { co_return ::pthread_self(); };
            const pthread_t thread = at.run(self(at.host->loop()));
            std::atomic<bool> enough{false};
            std::thread storm([&] {
                while (!enough) {
                    ::pthread_kill(thread, SIGUSR2);
                    std::this_thread::yield();
                }
            });
            auto come = ise::async_run(at.host->loop().get_executor(), read_all(*two.far), asio::use_future);
            at.run(write_all(*two.near, much));
            CHECK(come.get() == much);
            enough = true;
            storm.join();
            at.run(drop(two));
        }
    ::sigaction(SIGUSR2, &before, nullptr);
}

} // namespace sockets_test
