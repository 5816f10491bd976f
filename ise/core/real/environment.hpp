#pragma once
#include <ise/core/environment.hpp>

#include <memory>

namespace ise {

/// The real world: the machine's clocks, threads, sockets and serial ports. One per process. It must outlive the
/// nodes and loops made from it; its destructor waits for the threads of its loops, and for offloaded work.
class real_environment final : public environment {
public:
    real_environment();
    ~real_environment() override;

    time_point now() const override;
    time_point recently() const override;
    wall_time wall() const override;
    std::uint64_t random() override;
    const process_identity& identity() const override;
    std::optional<std::string> variable(const std::string& name) const override;
    std::unique_ptr<loop_host> make_loop(const std::string& name) override;
    std::unique_ptr<loop_host> adopt(asio::any_io_executor executor, bool one_thread) override;
    void offload(std::function<void()> work) override;
    bool is_virtual() const noexcept override { return false; }
    task<result<std::unique_ptr<stream>>> connect(loop& on, endpoint to) override;
    result<std::unique_ptr<listener>> listen(loop& on, const endpoint& at) override;
    result<std::unique_ptr<datagram_socket>> open_datagram(loop& on, const endpoint& at) override;
    result<std::unique_ptr<stream>> open_serial(loop& on, const serial_options& options) override;
    result<pseudo_terminal> open_pseudo_terminal(loop& on, const std::string& link) override;
    result<std::string> read_file(const std::string& path, std::size_t max_bytes) override;
    result<std::string> read_secret(const std::string& path, std::size_t max_bytes) override;
    result<std::string> read_trusted(const std::string& path, std::size_t max_bytes) override;
    std::vector<std::string> interface_addresses() const override;

private:
    struct state;
    std::unique_ptr<state> state_;
};

} // namespace ise
