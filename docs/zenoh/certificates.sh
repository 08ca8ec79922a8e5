#!/bin/sh
# An authority of one's own and a certificate for everyone who is to be let in; ten years long.
#
#   sh docs/zenoh/certificates.sh certificates
#
# Keep ca.key to yourself: whoever has it lets in whom he likes.
set -eu
folder=${1:?give a folder}
mkdir -p "$folder"
cd "$folder"
openssl req -x509 -newkey ec -pkeyopt ec_paramgen_curve:prime256v1 -nodes -days 3650 \
    -subj "/CN=robot authority" -keyout ca.key -out ca.pem 2>/dev/null
for name in router emulator controller watcher; do
    openssl req -newkey ec -pkeyopt ec_paramgen_curve:prime256v1 -nodes \
        -subj "/CN=$name" -keyout "$name.key" -out "$name.csr" 2>/dev/null
    printf 'subjectAltName=DNS:localhost,IP:127.0.0.1\nextendedKeyUsage=serverAuth,clientAuth\n' > "$name.ext"
    openssl x509 -req -in "$name.csr" -CA ca.pem -CAkey ca.key -CAcreateserial -days 3650 \
        -extfile "$name.ext" -out "$name.pem" 2>/dev/null
    rm "$name.csr" "$name.ext"
done
chmod 600 ./*.key
