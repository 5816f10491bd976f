#pragma once
#include <ise/core/environment.hpp>
#include <ise/core/loop.hpp>
#include <ise/core/stream.hpp>
#include <ise/core/waiter.hpp>
#include <ise/name_server/name_store.hpp>
#include <ise/transport/security.hpp>

#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace ise {

struct etcd_options {
    std::vector<endpoint> members; ///< their client endpoints, over tcp or tls
    std::string user;              ///< empty: without authentication
    std::string password;
    std::shared_ptr<net::tls::identity> tls; ///< for members over tls: authorities and, perhaps, a certificate
    std::string prefix = "/ise/names/";      ///< of all keys: one for each system
};

/// "etcd://a:2379,b:2379,c:2379", or "etcds://…" over TLS. Errors: errc::invalid_argument.
result<std::vector<endpoint>> parse_etcd_members(std::string_view text);

/// etcd 3.4 by its JSON gateway, over HTTP/1.1. Asks one member, and the next one when it does not answer.
class etcd_store final : public name_store {
public:
    etcd_store(loop& on, etcd_options options);
    ~etcd_store() override;

    task<result<store_snapshot>> read() override;
    task<result<std::vector<store_outcome>>> write(std::vector<store_step> steps) override;
    task<result<std::uint64_t>> probe() override;
    task<result<void>> grant(std::uint64_t lease, duration length) override;
    task<result<void>> keep(std::uint64_t lease, duration within) override;
    task<result<void>> revoke(std::uint64_t lease) override;
    task<failure> follow(std::uint64_t revision,
                         std::function<void(const std::vector<store_change>&, std::uint64_t)> on_changes) override;

    void end_watch() override;

    static constexpr std::size_t max_answer_bytes = std::size_t{512} << 20;

private:
    class line;

    /// The member that is asked at present, and connections to it. Renewals of leases stay at a member that is too slow
    /// for all else.
    struct route {
        std::size_t member = 0;
        std::vector<std::unique_ptr<line>> idle;
    };

    task<result<std::unique_ptr<line>>> dial(std::size_t member, time_point deadline);
    /// The answer's JSON. Tries the next member the next time after a failure. Cancellation: terminal.
    task<result<std::string>> post(std::string target, std::string body) {
        return post(asking_, std::move(target), std::move(body), patience);
    }
    task<result<std::string>> post(route& by, std::string target, std::string body, duration within);
    /// `more`: further lines of its head.
    std::string request_text(std::string_view target, const std::string& body, std::string_view more = {}) const;
    task<result<std::string>> post_once(route& by, std::string target, std::string body, duration within);
    /// There is a token: at once, or by the log-in that is under way, or by one of its own.
    task<result<void>> log_in(route& by, duration within);
    task<result<std::string>> new_token(route& by, duration within);
    void pass_over(route& by, std::size_t member);

    loop& on_;
    etcd_options options_;
    route asking_, keeping_;
    std::string token_;
    struct log_in_under_way {
        std::optional<result<void>> outcome; // nothing at its end: it was cancelled
        std::vector<waiter<>*> waiting;
    };
    std::shared_ptr<log_in_under_way> logging_in_;
    line* watching_ = nullptr;
};

} // namespace ise
