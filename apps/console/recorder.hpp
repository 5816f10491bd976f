#pragma once
#include <components/gui_client/view.hpp>

#include <QFile>
#include <QString>

#include <cstdint>

namespace atirma::console {

/// Writes every packet as it came into a CSV file: number, times, proxy, link, boot, sequence, history, kind, bytes
/// in hex.
class recorder {
public:
    /// Empty, or why it cannot be written.
    QString start(const QString& path);
    void stop();
    bool running() const { return file_.isOpen(); }
    QString path() const { return file_.fileName(); }
    std::uint64_t written() const noexcept { return written_; }
    /// Packets that came and went between two snapshots.
    std::uint64_t missed() const noexcept { return missed_; }
    /// Writes what is new. Empty, or what went wrong: then it has stopped.
    QString take(const snapshot& seen);

private:
    QFile file_;
    std::uint64_t last_ = 0, written_ = 0, missed_ = 0;
};

/// Writes a whole file, by way of a new one beside it. Empty, or why not.
QString write_file(const QString& path, const std::string& content);

} // namespace atirma::console
